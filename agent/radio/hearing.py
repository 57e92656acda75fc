"""What a drone's process hears: bytes become rows of frames, and what must not be believed is counted by its reason."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.ports import Heard
from agent.radio.air import Air
from protocols.kernels import by_reference, inlined_kernel, kernel
from protocols.wire import messages
from protocols.wire.frames import REASONS, Frames, body_bytes, fault, read_frame
from protocols.wire.heard import ENTRY_BYTES
from protocols.wire.rows import get_number

_OLDEST_FRAME = 200  # ticks; the medium delays no frame longer
_MALFORMED, _WRONG_SENDER = REASONS.index("malformed"), REASONS.index("sender")


class Ears(NamedTuple):
    """What kernels that hear work on.

    data: what is heard. believed: (MAX_HEARD,) the rows of frames that are. rejected: how many are not, per `REASONS`. note:
    (MAX_HEARD, 2) where in ``data`` the note of a loud row lies, and its size.
    """

    me: int
    tag: int
    agents: int
    data: NDArray[np.uint8]
    frames: Frames
    believed: NDArray[np.int64]
    rejected: NDArray[np.int64]
    note: NDArray[np.int64]


@inlined_kernel
def entry_end(at: int, end: int, data: NDArray[np.uint8]) -> int:
    """Where the entry that begins at ``at`` ends (protocols.wire.heard); -1 if it is not whole."""
    if at + ENTRY_BYTES > end:
        return -1
    beyond = at + ENTRY_BYTES + get_number(data, at + 2, 2)
    return beyond if beyond <= end else -1


@inlined_kernel
def hear_entry(tick: int, at: int, beyond: int, row: int, ears: Ears) -> int:
    """Read the frame of a whole entry into ``row``.

    Returns:
        Why it must not be believed, as an index of `REASONS`; -1 if it may be, if its note may, should it be loud.
    """
    data, frames = ears.data, ears.frames
    source = get_number(data, at, 2)
    begin = at + ENTRY_BYTES
    reason = read_frame(data, begin, beyond - begin, ears.tag, frames, row)
    if reason >= 0:
        return reason
    sender = int(np.int64(frames.sender[row]))
    if sender != source or sender == ears.me:
        return _WRONG_SENDER
    return fault(frames, row, tick, _OLDEST_FRAME, ears.agents)


@kernel
def _listen(tick: int, at: int, end: int, count: int, ears: Ears) -> int:
    """Read ``count`` frames that lie in ``data`` from ``at`` to ``end`` (protocols.wire.heard) into rows, put those that may be
    believed into ``believed`` and count the others.

    Returns:
        How many are believed; if there are loud ones among them, whose notes are still to be read, -1 minus that.
    """
    frames, good, loud = ears.frames, 0, False
    for _ in range(count):
        if good == ears.believed.shape[0]:
            break
        beyond = entry_end(at, end, ears.data)
        if beyond < 0:
            ears.rejected[_MALFORMED] += 1
            break
        reason = hear_entry(tick, at, beyond, good, ears)
        if reason >= 0:
            ears.rejected[reason] += 1
        else:
            if frames.loud[good]:
                loud = True
                ears.note[good, 0] = at + ENTRY_BYTES + body_bytes(frames, good)
                ears.note[good, 1] = beyond - ears.note[good, 0]
            ears.believed[good] = good
            good += 1
        at = beyond
    return -1 - good if loud else good


class Hearing:
    """The ears of drone ``me`` of ``agents``, which fill the first rows of ``air``.

    Attributes:
        believed: (MAX_HEARD,) the rows of the frames of this tick that may be believed, as many as `hear` says.
    """

    def __init__(self, air: Air, me: int, agents: int) -> None:
        self._air, self._me, self._agents = air, me, agents
        self.believed = np.zeros(messages.MAX_HEARD, np.int64)
        self._rejected = np.zeros(len(REASONS), np.int64)
        self._note = np.zeros((messages.MAX_HEARD, 2), np.int64)
        self._listen_to(np.zeros(0, np.uint8))

    def _listen_to(self, data: NDArray[np.uint8]) -> None:
        self._data, self._ears = data, by_reference(self.ears(data))

    def ears(self, data: NDArray[np.uint8]) -> Ears:
        """What kernels need to hear what is in ``data``."""
        air = self._air
        return Ears(
            self._me, air.tag, self._agents, data, air.frames, self.believed, self._rejected, self._note
        )

    @property
    def rejected(self) -> dict[str, int]:
        """Frames dropped so far, by reason."""
        return dict(zip(REASONS, self._rejected.tolist(), strict=True))

    def hear(self, tick: int, heard: Heard) -> int:
        """How many of the frames may be believed, now in the rows ``believed``.

        Bad frames, and those in which a drone speaks in another's name, are counted and dropped.
        """
        data, at, end, frames = heard
        if not frames:
            return 0
        if data is not self._data:
            self._listen_to(data)
        good = _listen(tick, at, end, frames, self._ears)
        return good if good >= 0 else self._read_notes(-1 - good)

    def _read_notes(self, good: int) -> int:
        kept = 0
        for row in self.believed[:good].tolist():
            if self._air.frames.loud[row]:
                at, size = self._note[row].tolist()
                try:
                    self._air.read_note(row, self._data[at : at + size].tobytes())
                except Exception:  # whatever its bytes do to their reader, they cost no more than one frame
                    self._rejected[_MALFORMED] += 1
                    continue
            self.believed[kept] = row
            kept += 1
        return kept
