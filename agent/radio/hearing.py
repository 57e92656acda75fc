"""What a drone's process hears: bytes become rows of frames, and what must not be believed is counted by its reason."""

import numpy as np
from numpy.typing import NDArray

from agent.core import AgentCore
from agent.tick_arrays import TickArrays
from protocols.kernels import kernel
from protocols.slots.agreement import decode
from protocols.slots.notes import quiet_digest
from protocols.wire import messages
from protocols.wire.frames import REASONS, FrameCodec, FrameError, fault

_OLDEST_FRAME = 200  # ticks; the medium delays no frame longer


@kernel
def _sift(tick: int, heard: int, arrays: TickArrays, rejected: NDArray[np.int64]) -> None:
    """Put the frames in rows 0 to ``heard`` - 1 that may be believed into the inbox of the one drone; count the others."""
    work, frames, agents = arrays.work, arrays.frames, arrays.views.slot_of.shape[1]
    good = 0
    for row in range(heard):
        reason = fault(frames, row, tick, _OLDEST_FRAME, agents)
        if reason >= 0:
            rejected[reason] += 1
        else:
            work.inbox[good] = row
            good += 1
    work.inbox_start[1] = good


class Hearing:
    """The ears of the one drone of ``core``."""

    def __init__(self, core: AgentCore, codec: FrameCodec) -> None:
        self._core, self._codec = core, codec
        self._me = int(core.work.me[0])
        self._digest, self._loud = core.frames.digest.data, core.frames.loud.data
        self._rejected = np.zeros(len(REASONS), np.int64)

    @property
    def rejected(self) -> dict[str, int]:
        """Frames dropped so far, by reason."""
        return dict(zip(REASONS, self._rejected.tolist(), strict=True))

    def hear(self, tick: int, sources: bytes, heard: list[bytes]) -> None:
        """Fill the inbox with the frames that may be believed; ``sources[i]`` sent ``heard[i]``.

        Bad frames, and those in which a drone speaks in another's name, are counted and dropped.
        """
        row = 0
        for source, data in zip(sources[: messages.MAX_HEARD], heard, strict=False):
            try:
                sender, note = self._codec.decode(data, row)
                if sender != source or sender == self._me:
                    raise FrameError("sender")
                self._keep_note(row, note)
            except FrameError as error:
                self._rejected[REASONS.index(error.reason)] += 1
                continue
            row += 1
        _sift(tick, row, self._core.arrays, self._rejected)

    def _keep_note(self, row: int, encoded: object) -> None:
        digest = quiet_digest(encoded)
        if digest is not None:
            self._digest[row], self._loud[row] = digest, 0
            return
        try:
            note = decode(encoded, self._core.mission.agents)
        except (ValueError, TypeError) as error:
            raise FrameError("malformed") from error
        self._core.notes[row] = note
        self._digest[row], self._loud[row] = note.digest, not (note.quiet and note.settled)
