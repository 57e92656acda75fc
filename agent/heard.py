"""The neighbours of a drone that sees nobody: where others are by their own word, by what their neighbours say of them, and how
much nearer they may be than that.

What a drone tells on, and what it trades slots by, is what it heard itself, moved on (`find_heard`). To keep clear it also
takes in those of whom only others have heard lately, and the older what it knows of a drone, the nearer it takes it to be
(`keep_clear`).
"""

import numpy as np
from numpy.typing import NDArray

from agent.memory import Memory, put_neighbour
from agent.tick_arrays import Rules
from protocols.arithmetic import length
from protocols.dynamics import TICK_S, Vector, vector
from protocols.kernels import inlined_kernel
from protocols.relative import NEVER, RadioRules
from protocols.wire.sensed import Sensed

_STEADY_S = 0.2  # for so long a drone is taken to accelerate as it did between its last two frames
_LATE_TICKS = 2  # a frame that comes so much after its time was not lost
_LASTING = 4  # times as long as a frame is believed, nobody is taken to be gone
_GROWTH_MPS, _GROWTH_MPS2 = 0.15, 3.0  # of the doubt about where a drone is
_MOST_M = 0.8  # more doubt than this, and nobody would pass anybody
_LISTENS = 2  # times as long as a frame is believed, a drone that begins stands still and listens
_BRAKE_PER_S = 4.0


@inlined_kernel
def note_acceleration(
    now: NDArray[np.float32], before: NDArray[np.float32], ticks: int, most: int, out: NDArray[np.float64]
) -> None:
    """Write to ``out`` (2,) how a drone has accelerated [m/s^2] between two frames, ``ticks`` apart, that say p and v (4,); zero
    if these are more than ``most``."""
    for axis in range(2):
        change = np.float64(now[2 + axis]) - np.float64(before[2 + axis])
        out[axis] = change / (ticks * TICK_S) if ticks <= most else 0.0


@inlined_kernel
def _moved_on(memory: Memory, row: int, other: int, age: int, a_max: float) -> tuple[Vector, Vector]:
    """Where ``other`` is [m], and its velocity [m/s], ``age`` ticks after its last frame, as far as one can tell."""
    motion, turning = memory.heard_motion[row, other], memory.heard_acceleration[row, other]
    t = age * TICK_S
    steady = min(t, _STEADY_S)
    faster = steady * min(1.0, a_max / max(length(turning[0], turning[1]), 1e-9))
    farther = faster * (t - 0.5 * steady)
    return (
        (motion[0] + motion[2] * t + turning[0] * farther, motion[1] + motion[3] * t + turning[1] * farther),
        (motion[2] + turning[0] * faster, motion[3] + turning[1] * faster),
    )


@inlined_kernel
def find_heard(
    memory: Memory, row: int, me: int, tick: int, sensed: Sensed, radio: RadioRules, a_max: float
) -> None:
    """Neighbours from frames that are still believed, moved on."""
    (px, py), (vx, vy) = vector(sensed.position, row), vector(sensed.velocity, row)
    count = 0
    for other in range(memory.heard_tick.shape[1]):
        age = tick - memory.heard_tick[row, other]
        if other == me or age > radio.memory_ticks or count == memory.near_id.shape[1]:
            continue
        (x, y), (wx, wy) = _moved_on(memory, row, other, age, a_max)
        if (x - px) * (x - px) + (y - py) * (y - py) <= radio.range_m * radio.range_m:
            put_neighbour(memory, row, count, other, (x - px, y - py), (wx - vx, wy - vy))
            count += 1
    memory.near_count[row] = count


@inlined_kernel
def _keep_clear_of(
    memory: Memory, row: int, other: int, rel: Vector, vel: Vector, age: int, range_m: float
) -> None:
    """Take ``other`` to be at ``rel`` [m], or nearer by the doubt that ``age`` ticks give, and to move at ``vel`` [m/s], both
    minus mine; instead of what was known of it, or as one more."""
    at, count = 0, memory.near_count[row]
    while at < count and memory.near_id[row, at] != other:
        at += 1
    distance, t = length(rel[0], rel[1]), age * TICK_S
    if at == memory.near_id.shape[1] or (at == count and distance > range_m):
        return
    doubt = min(_GROWTH_MPS * t + 0.5 * _GROWTH_MPS2 * t * t, _MOST_M)
    share = max(distance - doubt, 0.1 * distance) / max(distance, 1e-9)
    put_neighbour(memory, row, at, other, (rel[0] * share, rel[1] * share), vel)
    memory.near_count[row] = max(count, at + 1)


@inlined_kernel
def keep_clear(memory: Memory, row: int, me: int, tick: int, sensed: Sensed, rules: Rules) -> None:
    """After `find_heard`: place whom the drone has missed by the neighbour that heard it last, remember the others for longer
    than their frames are believed, and doubt all of it with its age."""
    radio, a_max = rules.radio, rules.limits.max_acceleration
    (px, py), (vx, vy) = vector(sensed.position, row), vector(sensed.velocity, row)
    direct, lasting = memory.near_count[row], _LASTING * radio.memory_ticks
    latest = memory.freshest[row]  # tick of the latest word of each drone, its own or another's
    for other in range(latest.shape[0]):
        latest[other] = memory.heard_tick[row, other]
    for index in range(direct):
        via = memory.near_id[row, index]
        for entry in range(memory.heard_one_hop[row, via]):
            other = memory.heard_known[row, via, entry]
            latest[other] = max(latest[other], memory.heard_tick[row, via])
    for index in range(direct):
        via = memory.near_id[row, index]
        told = memory.heard_tick[row, via]
        for entry in range(memory.heard_one_hop[row, via]):
            other = int(np.int64(memory.heard_known[row, via, entry]))
            own = memory.heard_tick[row, other]
            missed = tick - own > rules.frame_every + _LATE_TICKS
            if other == me or not missed or told <= own or told != latest[other]:
                continue
            latest[other] = NEVER  # placed; another that knows as much has nothing to add
            from_via, ahead = memory.heard_displacement[row, via, entry], (tick - told) * TICK_S
            like = other if tick - own <= lasting else via  # a swarm moves together
            said, its = memory.heard_motion[row, via], memory.heard_motion[row, like]
            rel = (
                said[0] + from_via[0] + its[2] * ahead - px,
                said[1] + from_via[1] + its[3] * ahead - py,
            )
            _keep_clear_of(memory, row, other, rel, (its[2] - vx, its[3] - vy), tick - told, radio.range_m)
    for other in range(latest.shape[0]):
        age = tick - memory.heard_tick[row, other]
        if other != me and latest[other] == memory.heard_tick[row, other] and age <= lasting:
            (x, y), (wx, wy) = _moved_on(memory, row, other, age, a_max)
            _keep_clear_of(memory, row, other, (x - px, y - py), (wx - vx, wy - vy), age, radio.range_m)


@inlined_kernel
def listens(tick: int, row: int, rules: Rules, memory: Memory) -> bool:
    """Whether a drone that sees nobody has only just begun: around it may be some whom it has not heard yet."""
    return not rules.by_sensor and tick - memory.began[row] < _LISTENS * rules.radio.memory_ticks


@inlined_kernel
def stand_still(velocity: Vector) -> Vector:
    """The acceleration [m/s^2] that brakes to a hover."""
    return -_BRAKE_PER_S * velocity[0], -_BRAKE_PER_S * velocity[1]
