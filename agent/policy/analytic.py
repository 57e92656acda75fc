"""Policy ``analytic``: the hand-made decentralized controller (attraction, obstacles, neighbours)."""

import numpy as np
from numpy.typing import NDArray

from agent.policy.analytic_kernel import analytic
from agent.policy.base import Seen
from agent.tick_arrays import TickArrays
from protocols.kernels import borrowed, kernel
from protocols.mission.document import Mission


@kernel
def _act(arrays: TickArrays, wanted: NDArray[np.float64]) -> None:
    work, memory, motion = borrowed(arrays.work), borrowed(arrays.memory), borrowed(arrays.sensed).motion
    for row in range(work.me.shape[0]):
        if work.awake[row]:
            wanted[row, 0], wanted[row, 1] = analytic(
                work.chain_error[row],
                work.slot_error[row],
                motion[row, 2:4],
                work.target_velocity[row],
                memory.near_count[row],
                memory.near_rel[row],
                memory.near_vel[row],
                memory.disc_count[row],
                memory.obstacle_rel[row],
                memory.obstacle_radius[row],
                memory.disc_side[row],
                arrays.rules.gains,
            )


class Analytic:
    """Steers to the slot around obstacles and neighbours, without learning and without planning ahead."""

    def __init__(self, mission: Mission) -> None:
        self._wanted = np.zeros((0, 2))

    def act(self, seen: Seen) -> NDArray[np.float64]:
        """Wanted acceleration (A, 2) m/s^2; remembers the side on which each obstacle is passed."""
        if len(self._wanted) != len(seen.awake):
            self._wanted = np.zeros((len(seen.awake), 2))
        _act(seen.arrays, self._wanted)
        return self._wanted
