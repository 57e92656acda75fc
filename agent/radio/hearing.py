"""What a drone's process hears: bytes become rows of frames, and what must not be believed is counted by its reason."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.radio.air import Air
from protocols.kernels import by_reference, kernel
from protocols.wire import messages
from protocols.wire.frames import REASONS, FrameError, Frames, fault

_OLDEST_FRAME = 200  # ticks; the medium delays no frame longer


class _Ears(NamedTuple):
    """What `_sift` works on: frames heard, the rows of those that are believed (MAX_HEARD,), how many are not, per `REASONS`."""

    frames: Frames
    believed: NDArray[np.int64]
    rejected: NDArray[np.int64]


@kernel
def _sift(tick: int, heard: int, agents: int, ears: _Ears) -> int:
    """Put those of the first ``heard`` rows that may be believed into ``believed``, count the others; how many are believed."""
    frames, believed, rejected = ears.frames, ears.believed, ears.rejected
    good = 0
    for row in range(heard):
        reason = fault(frames, row, tick, _OLDEST_FRAME, agents)
        if reason >= 0:
            rejected[reason] += 1
        else:
            believed[good] = row
            good += 1
    return good


class Hearing:
    """The ears of drone ``me`` of ``agents``, which fill the first rows of ``air``."""

    def __init__(self, air: Air, me: int, agents: int) -> None:
        self._air, self._me, self._agents = air, me, agents
        self._believed = np.zeros(messages.MAX_HEARD, np.int64)
        self._rejected = np.zeros(len(REASONS), np.int64)
        self._ears = by_reference(_Ears(air.frames, self._believed, self._rejected))

    @property
    def rejected(self) -> dict[str, int]:
        """Frames dropped so far, by reason."""
        return dict(zip(REASONS, self._rejected.tolist(), strict=True))

    def hear(self, tick: int, sources: bytes, heard: list[bytes]) -> NDArray[np.int64]:
        """The rows of the frames that may be believed; ``sources[i]`` sent ``heard[i]``.

        Bad frames, and those in which a drone speaks in another's name, are counted and dropped.
        """
        row, unpack, me = 0, self._air.unpack, self._me
        for source, data in zip(sources[: messages.MAX_HEARD], heard, strict=False):
            try:
                sender = unpack(data, row)
                if sender != source or sender == me:
                    raise FrameError("sender")
            except FrameError as error:
                self._rejected[REASONS.index(error.reason)] += 1
                continue
            row += 1
        good = _sift(tick, row, self._agents, self._ears)
        return self._believed[:good]
