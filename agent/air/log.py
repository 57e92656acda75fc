"""What one end of the air saw of a flight, tick by tick: the rows of a recording (docs/recordings.md)."""

import numpy as np
from numpy.typing import NDArray

from agent.air.contacts import Contact, mover_of
from protocols.fleet.plan import Plan

_SPARE_TICKS = 3000  # after the mission: for who holds, and lands


class FlightLog:
    """Positions (T, N, 2) [m], velocities (T, N, 2) [m/s] of the mission; slots (T, N), flying (T, N); heights (T, N) [m] of the
    room. Rows are ticks of the mission; ``rows`` is T so far. A tick that was missed is as the one before.
    """

    def __init__(self, plan: Plan) -> None:
        agents, rows = plan.mission.agents, plan.ticks + _SPARE_TICKS
        self._place = plan.place
        self.rows = 0
        self.positions = np.zeros((rows, agents, 2))
        self.velocities = np.zeros((rows, agents, 2))
        self.heights = np.zeros((rows, agents), np.float32)
        self.slots = np.zeros((rows, agents), np.int16)
        self.flying = np.zeros((rows, agents), np.bool_)
        self.positions[0] = [plan.place.to_mission(start) for start in plan.starts]
        self.slots[0] = np.arange(agents)

    def record(self, tick: int, contacts: dict[int, Contact], now: float) -> None:
        """Keep where all are at ``tick``, as last heard."""
        if not self.rows <= tick < len(self.flying):
            return
        for array in (self.positions, self.velocities, self.heights, self.slots, self.flying):
            _fill(array, max(0, self.rows - 1), tick)
        for number, contact in contacts.items():
            mover = mover_of(contact, now)
            self.positions[tick, number] = self._place.to_mission(mover.p[:2])
            self.velocities[tick, number] = self._place.turned_back(mover.v[:2])
            self.heights[tick, number] = mover.p[2]
            self.slots[tick, number] = min(contact.beacon.slot, self.slots.shape[1] - 1)
            self.flying[tick, number] = contact.beacon.flying
        self.rows = tick + 1


def _fill(array: NDArray[np.generic], last: int, tick: int) -> None:
    array[last + 1 : tick + 1] = array[last]
