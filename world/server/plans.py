"""Where the drones of one world plan to be, as far as they have told: for those who look on. What cannot be is not taken."""

import numpy as np
from numpy.typing import NDArray

from protocols.wire.planned import SHOWN, is_near, unpack_plan
from world.core import WorldCore


class Plans:
    """Of the N drones of ``core``."""

    def __init__(self, core: WorldCore) -> None:
        agents = core.shape[1]
        self._position, self._speed_mps = core.position[0], core.missions[0].limits.speed_mps
        self._tick, self._told = np.zeros((agents, SHOWN), np.int64), False
        self._place = np.zeros((agents, SHOWN, 2), np.float32)

    def take(self, agent: int, tick: int, plan: bytes) -> None:
        """What this drone planned at this tick, packed, if it could be so."""
        planned = unpack_plan(plan)
        if is_near(planned, self._position[agent], self._speed_mps):
            self._tick[agent], self._place[agent], self._told = tick + planned.after, planned.place, True

    def forget(self, agent: int) -> None:
        """This drone has been restarted, and knows of no plan."""
        self._tick[agent] = 0

    def ahead(self, tick: int) -> NDArray[np.float32] | None:
        """As world.director.Swarm.plans: what is still ahead as this tick begins. None if nobody has told anything."""
        return (
            np.where((self._tick > tick)[:, :, None], self._place, np.float32(np.nan)) if self._told else None
        )
