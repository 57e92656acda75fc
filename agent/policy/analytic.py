"""Policy ``analytic``: the hand-made decentralized controller (attraction, obstacles, neighbours)."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from agent.memory import discs_of, neighbours_of
from agent.observation import aim_of
from agent.policy.analytic_kernel import analytic
from agent.policy.base import Compiled
from agent.quick import RARE, Quick, begin_tick, end_tick
from agent.tick_arrays import TickArrays
from protocols.kernels import bound, inlined_kernel, kernel
from protocols.mission.document import Mission


@inlined_kernel
def _steer(arrays: TickArrays, wanted: NDArray[np.float64]) -> None:
    memory = arrays.memory
    for row in range(arrays.work.me.shape[0]):
        if arrays.work.awake[row]:
            wanted[row, 0], wanted[row, 1] = analytic(
                aim_of(row, arrays.work, arrays.sensed),
                neighbours_of(memory, row),
                discs_of(memory, row),
                arrays.rules.gains,
            )


@kernel
def _act(arrays: TickArrays, wanted: NDArray[np.float64]) -> None:
    _steer(arrays, wanted)


@kernel
def _fly(quick: Quick) -> int:
    tick = begin_tick(quick)
    if tick < 0:
        return RARE
    _steer(quick.arrays, quick.command)
    return end_tick(tick, quick)


class Analytic(Compiled):
    """Steers to the slot around obstacles and neighbours, without learning and without planning ahead; remembers the side on
    which each obstacle is passed.
    """

    def __init__(self, mission: Mission) -> None:
        pass

    def act_on_arrays(self, tick: int, arrays: TickArrays, wanted: NDArray[np.float64]) -> None:
        _act(arrays, wanted)

    def quickly(self, quick: Quick) -> Callable[[], int]:
        return bound(_fly, quick)
