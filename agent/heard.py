"""The neighbours of a drone that sees nobody: where others are by their own word, by what their neighbours say of them, and how
much nearer they may be than that.

Others say where a drone is, not how it moves: that follows from where it was before (`take_word`). Without it two that had missed
each other knew where the other was, and took it to move as it had a second ago: most collisions were such.

What a drone tells on, and what it trades slots by, is of those whom it has heard itself lately (`find_heard`). To keep clear it
also takes in those of whom only others have, and the older what it knows of a drone, the nearer it takes it to be (`keep_clear`).
"""

import numpy as np
from numpy.typing import NDArray

from agent.memory import Memory, put_neighbour
from agent.tick_arrays import Rules
from protocols.arithmetic import length
from protocols.dynamics import TICK_S, Vector, clip_ball, vector
from protocols.kernels import inlined_kernel
from protocols.relative import RadioRules
from protocols.wire.sensed import Sensed

_STEADY_S = 0.2  # for so long a drone is taken to accelerate as it did between its last two frames
_LATE_TICKS = 2  # a frame that comes so much after its time was not lost
_TURNED = 1.5  # at the end, the velocity of who turns at random has changed by so much more than its mean
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
def _by_news(memory: Memory, row: int, other: int, tick: int, a_max: float) -> tuple[Vector, Vector]:
    """Where ``other`` is [m], and its velocity [m/s], by the latest news of it, as far as one can tell. How it accelerated is
    known of its own word alone."""
    motion, latest, turning = memory.news_motion[row, other], memory.news_tick[row, other], (0.0, 0.0)
    if latest == memory.heard_tick[row, other]:
        turning = vector(memory.heard_acceleration[row], other)
    t = (tick - latest) * TICK_S
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
    """Neighbours whose frames are still believed, where the latest news of them says, moved on."""
    (px, py), (vx, vy) = vector(sensed.position, row), vector(sensed.velocity, row)
    count = 0
    for other in range(memory.heard_tick.shape[1]):
        age = tick - memory.heard_tick[row, other]
        if other == me or age > radio.memory_ticks or count == memory.near_id.shape[1]:
            continue
        (x, y), (wx, wy) = _by_news(memory, row, other, tick, a_max)
        if (x - px) * (x - px) + (y - py) * (y - py) <= radio.range_m * radio.range_m:
            put_neighbour(memory, row, count, other, (x - px, y - py), (wx - vx, wy - vy))
            count += 1
    memory.near_count[row] = count


@inlined_kernel
def _place(memory: Memory, row: int, other: int, via: int, told: int, where: Vector, rules: Rules) -> None:
    """Note the word of ``via`` that ``other`` was at ``where`` [m] at tick ``told``. That it was not where it was expected tells
    how it has turned since the last news, within what a drone can do."""
    news, later = memory.news_motion[row, other], told - memory.news_tick[row, other]
    if later > _LASTING * rules.radio.memory_ticks:
        moves = memory.heard_motion[row, via]  # a swarm moves together
        news[2], news[3] = moves[2], moves[3]
    else:
        a_max, t = rules.limits.max_acceleration, later * TICK_S
        (x, y), (wx, wy) = _by_news(memory, row, other, told, a_max)
        turn_x, turn_y = clip_ball(_TURNED * (where[0] - x) / t, _TURNED * (where[1] - y) / t, a_max * t)
        news[2], news[3] = clip_ball(wx + turn_x, wy + turn_y, rules.radio.speed_mps)
    news[0], news[1] = where
    memory.news_tick[row, other] = told


@inlined_kernel
def take_word(memory: Memory, row: int, me: int, sender: int, told: int, rules: Rules) -> None:
    """After all frames of a tick have been heard: note the news in that of ``sender`` from tick ``told``, if it was believed: of
    itself, and of those neighbours of it of whom no later word has come and who have been missed."""
    if memory.heard_tick[row, sender] != told:
        return
    said, news = memory.heard_motion[row, sender], memory.news_motion[row, sender]
    memory.news_tick[row, sender] = told
    for place in range(4):
        news[place] = said[place]
    for entry in range(memory.heard_one_hop[row, sender]):
        other = int(np.int64(memory.heard_known[row, sender, entry]))
        missed = told - memory.heard_tick[row, other] > rules.frame_every + _LATE_TICKS
        if other != me and missed and told > memory.news_tick[row, other]:
            from_sender = memory.heard_displacement[row, sender, entry]
            where = (np.float64(said[0]) + from_sender[0], np.float64(said[1]) + from_sender[1])
            _place(memory, row, other, sender, told, where, rules)


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
    """After `find_heard`: take others to be where the latest news of them says, for longer than frames are believed, and doubt
    it with its age."""
    (px, py), (vx, vy) = vector(sensed.position, row), vector(sensed.velocity, row)
    for other in range(memory.news_tick.shape[1]):
        age = tick - memory.news_tick[row, other]
        if other != me and age <= _LASTING * rules.radio.memory_ticks:
            (x, y), (wx, wy) = _by_news(memory, row, other, tick, rules.limits.max_acceleration)
            _keep_clear_of(memory, row, other, (x - px, y - py), (wx - vx, wy - vy), age, rules.radio.range_m)


@inlined_kernel
def listens(tick: int, row: int, rules: Rules, memory: Memory) -> bool:
    """Whether a drone that sees nobody has only just begun: around it may be some whom it has not heard yet."""
    return not rules.by_sensor and tick - memory.began[row] < _LISTENS * rules.radio.memory_ticks


@inlined_kernel
def stand_still(velocity: Vector) -> Vector:
    """The acceleration [m/s^2] that brakes to a hover."""
    return -_BRAKE_PER_S * velocity[0], -_BRAKE_PER_S * velocity[1]
