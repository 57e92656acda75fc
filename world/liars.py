"""Drones that lie, as a fault ``lie`` has it: what goes out by radio in place of what they say.

They fly, decide and give account of themselves as ever. In a launch the frame has come as bytes; a simulation packs the frames of
liars, and no others, to hand them in here: so both tell the same lies.
"""

from collections import deque

import numpy as np

from protocols.slots.seals import Stamps
from protocols.wire.frames import FIXED
from protocols.wire.lies import ECHO_TICKS, LIES, Honest
from world.core import WorldCore


class Liars:
    """Those of E worlds; row r is agent r % N of world r // N."""

    def __init__(self, core: WorldCore) -> None:
        self._core = core
        self._earlier: dict[int, deque[tuple[int, bytes]]] = {}  # since it lies: tick and frame

    @property
    def rows(self) -> list[int]:
        """Who lies now."""
        return sorted(self._core.condition.lies)

    def tell(self, row: int, tick: int, frame: bytes) -> bytes:
        """What the drone in this row says instead of its frame of this tick."""
        world, agent = divmod(row, self._core.shape[1])
        if len(frame) < FIXED.itemsize:  # no frame that anybody would read
            return frame
        earlier = self._earlier.setdefault(row, deque())
        while earlier and earlier[0][0] < tick - ECHO_TICKS:
            earlier.popleft()
        random = np.random.default_rng([self._core.missions[world].seed, agent, tick])
        honest = Honest(
            agent, self._core.shape[1], tick, frame, random, Stamps(agent).seal, [said for _, said in earlier]
        )
        earlier.append((tick, frame))
        return LIES[self._core.condition.lies[row]](honest)
