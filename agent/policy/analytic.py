"""Policy ``analytic``: the hand-made decentralized controller (attraction, obstacles, neighbours)."""

import numpy as np
from numpy.typing import NDArray

from agent.memory import discs_of, neighbours_of
from agent.observation import aim_of
from agent.policy.analytic_kernel import analytic
from agent.policy.base import Seen
from agent.tick_arrays import TickArrays
from protocols.kernels import kernel
from protocols.mission.document import Mission


@kernel
def _act(arrays: TickArrays, wanted: NDArray[np.float64]) -> None:
    memory = arrays.memory
    for row in range(arrays.work.me.shape[0]):
        if arrays.work.awake[row]:
            wanted[row, 0], wanted[row, 1] = analytic(
                aim_of(row, arrays.work, arrays.sensed),
                neighbours_of(memory, row),
                discs_of(memory, row),
                arrays.rules.gains,
            )


class Analytic:
    """Steers to the slot around obstacles and neighbours, without learning and without planning ahead."""

    many_flights = True

    def __init__(self, mission: Mission) -> None:
        self._wanted = np.zeros((0, 2))

    def act(self, seen: Seen) -> NDArray[np.float64]:
        """Wanted acceleration (A, 2) m/s^2; remembers the side on which each obstacle is passed."""
        if len(self._wanted) != len(seen.awake):
            self._wanted = np.zeros((len(seen.awake), 2))
        _act(seen.arrays, self._wanted)
        return self._wanted
