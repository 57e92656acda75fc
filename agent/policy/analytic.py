"""Policy ``analytic``: the hand-made decentralized controller (attraction, obstacles, neighbours)."""

import numpy as np
from numpy.typing import NDArray

from agent.control.gains import Gains
from agent.memory import Memory
from agent.policy.analytic_kernel import analytic
from agent.policy.base import Seen
from protocols.kernels import kernel
from protocols.mission import Mission


@kernel
def _act(
    awake: NDArray[np.bool_],
    velocity: NDArray[np.float64],
    target_velocity: NDArray[np.float64],
    chain_error: NDArray[np.float64],
    slot_error: NDArray[np.float64],
    memory: Memory,
    gains: Gains,
    wanted: NDArray[np.float64],
) -> None:
    for row in range(awake.shape[0]):
        if awake[row]:
            wanted[row, 0], wanted[row, 1] = analytic(
                chain_error[row],
                slot_error[row],
                velocity[row],
                target_velocity[row],
                memory.near_count[row],
                memory.near_rel[row],
                memory.near_vel[row],
                memory.disc_count[row],
                memory.obstacle_rel[row],
                memory.obstacle_radius[row],
                memory.disc_side[row],
                gains,
            )


class Analytic:
    """Steers to the slot around obstacles and neighbours, without learning and without looking ahead further than contact."""

    def __init__(self, mission: Mission) -> None:
        self._gains = Gains()

    def act(self, seen: Seen) -> NDArray[np.float64]:
        """Wanted acceleration (A, 2) m/s^2; remembers the side on which each obstacle is passed."""
        wanted = np.zeros((len(seen.awake), 2))
        _act(
            seen.awake,
            seen.velocity,
            seen.target_velocity,
            seen.chain_error,
            seen.slot_error,
            seen.memory,
            self._gains,
            wanted,
        )
        return wanted
