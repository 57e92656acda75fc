"""Aggregation over the air (paper, Eqs. 3 and 4): what a drone knows of others' observations, over so many hops, a tick a hop.

    X'^1_i(t) = mean over neighbours j of X_j(t - 1)         X'^l_i(t) = mean over neighbours j of X'^{l-1}_j(t - 1)

So a drone passes on what it has itself been told, and round l is what drones l hops away observed l ticks ago. This is also the
delayed aggregation of Tolstaya et al. Means travel in frames as X_i does (protocols.wire.frames), for policies that ask for them.
"""

import math

import numpy as np
from numpy.typing import NDArray

from agent.memory import Memory
from protocols.kernels import inlined_kernel
from protocols.relative import RadioRules
from protocols.wire.frames import OBSERVATION_UNIT

COUNTED = 8  # neighbours that count; of more, those with the lowest numbers


@inlined_kernel
def fixed_point(value: float) -> np.int16:
    """A number of an observation as it travels."""
    return np.int16(math.floor(min(max(value * OBSERVATION_UNIT, -32767.0), 32767.0) + 0.5))


@inlined_kernel
def tells(tick: int, row: int, other: int, radio: RadioRules, memory: Memory) -> bool:
    """Whether drone ``other`` is a neighbour whose last frame counts: one of the tick before, or an older one of a drone still
    near that is still believed."""
    age = tick - memory.heard_tick[row, other]
    return bool(age == 1 or (age <= radio.memory_ticks and memory.hops[row, other] == 1))


@inlined_kernel
def mean_over_neighbours(
    tick: int, row: int, radio: RadioRules, memory: Memory, means: NDArray[np.float64]
) -> None:
    """Write one row's rounds 1 ... L to ``means`` (L, 18), zeros where nobody tells; nothing is done where L = 0."""
    rounds, size = means.shape
    if rounds == 0:
        return
    for passed_on in range(rounds):
        for index in range(size):
            means[passed_on, index] = 0.0
    count = 0
    for other in range(memory.heard_tick.shape[1]):
        if count < COUNTED and tells(tick, row, other, radio, memory):
            count += 1
            for index in range(size):
                means[0, index] += memory.heard_observation[row, other, index]
                for passed_on in range(rounds - 1):
                    means[passed_on + 1, index] += memory.heard_relayed[row, other, passed_on, index]
    if count > 0:
        for passed_on in range(rounds):
            for index in range(size):
                means[passed_on, index] /= count * OBSERVATION_UNIT
