"""Where the drones of one world plan to be, as far as they have told: for those who look on. What cannot be is not taken."""

import numpy as np
from numpy.typing import NDArray

from protocols.wire.planned import PLAN_BYTES, SHOWN, are_near, unpack_plans
from world.core import WorldCore

_READ = -1


class Plans:
    """Of the N drones of ``core``. A plan is read when somebody looks.

    unread: (N, PLAN_BYTES) the last that each has told, packed. made_at: (N,) its tick, or `_READ`.
    """

    def __init__(self, core: WorldCore) -> None:
        agents = core.shape[1]
        self._position, self._speed_mps = core.position[0], core.missions[0].limits.speed_mps
        self.unread, self.made_at = np.zeros((agents, PLAN_BYTES), np.uint8), np.full(agents, _READ)
        self._until, self._told = np.zeros((agents, SHOWN), np.int64), False
        self._place = np.zeros((agents, SHOWN, 2), np.float32)

    def take(self, agent: int, tick: int, plan: bytes) -> None:
        """What this drone planned at this tick, packed."""
        self.unread[agent], self.made_at[agent] = np.frombuffer(plan, np.uint8), tick

    def forget(self, agent: int) -> None:
        """This drone has been restarted, and knows of no plan."""
        self.made_at[agent], self._until[agent] = _READ, 0

    def ahead(self, tick: int) -> NDArray[np.float32] | None:
        """As world.director.Swarm.plans: what is still ahead as this tick begins. None if nobody has told anything."""
        self._read(tick)
        if not self._told:
            return None
        return np.where((self._until > tick)[:, :, None], self._place, np.float32(np.nan))

    def _read(self, tick: int) -> None:
        """Believe, as this tick begins, what could be so."""
        (agents,) = np.nonzero(self.made_at != _READ)
        if not len(agents):
            return
        made_at, planned = self.made_at[agents], unpack_plans(self.unread[agents].tobytes())
        near = are_near(planned, tick - made_at, self._position[agents], self._speed_mps)
        believed = agents[near]
        self._until[believed] = (made_at[:, None] + planned.after)[near]
        self._place[believed] = planned.place[near]
        self._told |= bool(near.any())
        self.made_at[agents] = _READ
