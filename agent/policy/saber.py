"""Policy ``saber``: Olfati-Saber's flocking plus the formation term of our own controller, as the paper's baseline "Saber".

It reacts and never plans: obstacles push it back, and nothing tells it on which side to pass. How its constants were found, and
what it reaches with them, is told in docs/policies.md.
"""

import numpy as np
from numpy.typing import NDArray

from agent.control.attraction import attraction
from agent.control.flocking import Flocking, flocking, flocking_for
from agent.policy.base import Seen
from agent.tick_arrays import TickArrays
from protocols.kernels import kernel
from protocols.mission.document import Mission


@kernel
def _act(arrays: TickArrays, gains: Flocking, wanted: NDArray[np.float64]) -> None:
    work, memory, motion = arrays.work, arrays.memory, arrays.sensed.motion
    for row in range(work.me.shape[0]):
        if not work.awake[row]:
            continue
        v_x, v_y = motion[row, 2], motion[row, 3]
        vt_x, vt_y = work.target_velocity[row, 0], work.target_velocity[row, 1]
        leader_x = work.target_position[row, 0] - motion[row, 0]
        leader_y = work.target_position[row, 1] - motion[row, 1]
        flock_x, flock_y = flocking(
            memory.near_count[row], memory.near_rel[row], memory.near_vel[row], memory.disc_count[row],
            memory.obstacle_rel[row], memory.obstacle_radius[row], v_x, v_y, leader_x, leader_y, vt_x, vt_y, gains,
        )  # fmt: skip
        form_x, form_y = attraction(
            work.chain_error[row, 0], work.chain_error[row, 1], work.slot_error[row, 0], work.slot_error[row, 1],
            v_x, v_y, vt_x, vt_y, arrays.rules.gains,
        )  # fmt: skip
        wanted[row, 0], wanted[row, 1] = flock_x + form_x, flock_y + form_y


class Saber:
    """Flocks at the formation's spacing with all neighbours in sight, and is drawn to its slot as ``analytic`` is."""

    def __init__(self, mission: Mission) -> None:
        self._gains = flocking_for(mission)

    def act(self, seen: Seen) -> NDArray[np.float64]:
        """Wanted acceleration (A, 2) m/s^2."""
        wanted = np.zeros((len(seen.awake), 2))
        _act(seen.arrays, self._gains, wanted)
        return wanted
