"""Policy ``analytic``: the hand-made decentralized controller (attraction, obstacles, neighbours)."""

import numpy as np
from numpy.typing import NDArray

from agent.control.gains import Gains
from agent.policy.analytic_kernel import analytic
from agent.policy.base import Seen
from protocols.kernels import kernel
from protocols.mission import Mission


_GAINS = Gains()  # a constant of the kernel


@kernel
def _act(
    awake: NDArray[np.bool_],
    motion: NDArray[np.float64],
    chain_error: NDArray[np.float64],
    slot_error: NDArray[np.float64],
    near_count: NDArray[np.int64],
    near_rel: NDArray[np.float64],
    near_vel: NDArray[np.float64],
    disc_count: NDArray[np.int64],
    obstacle_rel: NDArray[np.float64],
    obstacle_radius: NDArray[np.float64],
    disc_side: NDArray[np.int8],
    wanted: NDArray[np.float64],
) -> None:
    for row in range(awake.shape[0]):
        if awake[row]:
            wanted[row, 0], wanted[row, 1] = analytic(
                chain_error[row],
                slot_error[row],
                motion[row, 2:4],
                motion[row, 6:8],
                near_count[row],
                near_rel[row],
                near_vel[row],
                disc_count[row],
                obstacle_rel[row],
                obstacle_radius[row],
                disc_side[row],
                _GAINS,
            )


class Analytic:
    """Steers to the slot around obstacles and neighbours, without learning and without planning ahead."""

    def __init__(self, mission: Mission) -> None:
        pass

    def act(self, seen: Seen) -> NDArray[np.float64]:
        """Wanted acceleration (A, 2) m/s^2; remembers the side on which each obstacle is passed."""
        wanted = np.zeros((len(seen.awake), 2))
        _act(
            seen.awake,
            seen.motion,
            seen.chain_error,
            seen.slot_error,
            seen.memory.near_count,
            seen.memory.near_rel,
            seen.memory.near_vel,
            seen.memory.disc_count,
            seen.memory.obstacle_rel,
            seen.memory.obstacle_radius,
            seen.memory.disc_side,
            wanted,
        )
        return wanted
