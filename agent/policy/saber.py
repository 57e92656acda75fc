"""Policy ``saber``: Olfati-Saber's flocking plus the formation term of our own controller, as the paper's baseline "Saber".

It reacts and never plans: obstacles push it back, and nothing tells it on which side to pass. How its constants were found, and
what it reaches with them, is told in docs/policies.md.
"""

import numpy as np
from numpy.typing import NDArray

from agent.control.attraction import attraction
from agent.control.flocking import Flocking, flocking, flocking_for
from agent.memory import discs_of, neighbours_of
from agent.observation import aim_of
from agent.policy.base import Compiled
from agent.tick_arrays import TickArrays
from protocols.dynamics import vector
from protocols.kernels import kernel
from protocols.mission.document import Mission


@kernel
def _act(arrays: TickArrays, gains: Flocking, wanted: NDArray[np.float64]) -> None:
    work, memory = arrays.work, arrays.memory
    for row in range(work.me.shape[0]):
        if not work.awake[row]:
            continue
        aim = aim_of(row, arrays.work, arrays.sensed)
        (x, y), (target_x, target_y) = vector(arrays.sensed.position, row), vector(work.target_position, row)
        flock_x, flock_y = flocking(
            neighbours_of(memory, row), discs_of(memory, row), aim.velocity, (target_x - x, target_y - y),
            aim.target_velocity, gains,
        )  # fmt: skip
        form_x, form_y = attraction(aim, arrays.rules.gains)
        wanted[row, 0], wanted[row, 1] = flock_x + form_x, flock_y + form_y


class Saber(Compiled):
    """Flocks at the formation's spacing with all neighbours in sight, and is drawn to its slot as ``analytic`` is."""

    def __init__(self, mission: Mission) -> None:
        self._gains = flocking_for(mission)

    def act_on_arrays(self, tick: int, arrays: TickArrays, wanted: NDArray[np.float64]) -> None:
        _act(arrays, self._gains, wanted)
