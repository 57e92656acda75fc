"""The way out of a pocket: a drone that obstacles have stopped flies the shortest way around those it knows.

Every reactive rule has pockets, places between obstacles where all its pushes and pulls cancel, and a policy that imitates one
has them too. So whoever has not come nearer to its slot for a while, and has obstacles in the way, plans instead: obstacles
grown by a margin become polygons, and the shortest way along their corners to the slot (A*) tells where to go next. Once around
them it flies straight on, faster than its policy would, until it has all but caught up with its slot.
"""

import math

import numpy as np
from numpy.typing import NDArray

from agent.control.agents import agent_terms
from agent.memory import Memory, neighbours_of
from agent.tick_arrays import Rules, Work
from protocols.arithmetic import cosine, length, sine
from protocols.dynamics import Vector, vector
from protocols.kernels import allocating_kernel, inlined_kernel
from protocols.wire.sensed import Sensed

STALLED_TICKS = 30  #: after which a drone counts as stopped
_CLOSING_MPS = 1.0  # nearing the slot more slowly is stalling
_FAR_M = 2.0  # nearer to the slot is arriving
_STANDING_MPS = 0.1  # who is slower stands
# Kept from surfaces on the way around, beyond what the safety filter keeps: room to fly in, also for a drone that can do less
# than it believes. Where there is no such way, hardly more than nothing, so that the way in is a way out.
_WIDE_M, _TIGHT_M = 0.2, 0.02
_CORNERS = 16  # of the polygon around a disc
_EXITS_M = (-1.0, -0.5, -0.25, 0.25, 0.5, 1.0)  # along a disc, from where one is close to it
_PLAN_TICKS = 10  # from plan to plan; where the obstacles are hardly changes
_REACHED_M = 0.6  # nearer to a corner the next one is looked for
_HOME_M = 4.0  # from here on, with nothing in the way, a drone is left to itself again
_AROUND_MPS, _HOME_MPS = 6.0, 8.0  # flown on the way around, and then
_CATCH_UP_MPS = 2.0  # by so much at least it is faster than its slot then
_GAIN = 3.0  # 1/s, on the velocity's error
_START, _GOAL = 0, 1


@inlined_kernel
def _touches(ax: float, ay: float, bx: float, by: float, disc_x: float, disc_y: float, radius: float) -> bool:
    """Whether the straight line from a to b passes a disc's centre nearer than ``radius``."""
    x, y = bx - ax, by - ay
    along = (disc_x - ax) * x + (disc_y - ay) * y
    share = min(max(along / max(x * x + y * y, 1e-12), 0.0), 1.0)
    miss_x, miss_y = ax + share * x - disc_x, ay + share * y - disc_y
    return miss_x * miss_x + miss_y * miss_y < radius * radius


@inlined_kernel
def _is_free(
    a: int,
    b: int,
    point: NDArray[np.float64],
    m: int,
    rel: NDArray[np.float64],
    radius: NDArray[np.float64],
    margin: float,
    leeway: float,
) -> bool:
    """Whether one can fly straight from point a to point b. A disc whose margin holds the start or the goal is passed no nearer
    than that is, up to ``leeway`` [m]."""
    for i in range(m):
        grown = radius[i] + margin
        for end in range(_GOAL + 1):
            if end != a and end != b:
                continue
            grown = min(grown, length(point[end, 0] - rel[i, 0], point[end, 1] - rel[i, 1]) - leeway)
        if grown > 0.0 and _touches(
            point[a, 0], point[a, 1], point[b, 0], point[b, 1], rel[i, 0], rel[i, 1], grown
        ):
            return False
    return True


@inlined_kernel
def _is_clear(
    x: float, y: float, m: int, rel: NDArray[np.float64], radius: NDArray[np.float64], margin: float
) -> bool:
    """Whether a point lies in no disc's margin."""
    inside = False
    for i in range(m):
        inside |= length(x - rel[i, 0], y - rel[i, 1]) < radius[i] + margin
    return not inside


@inlined_kernel
def _add_exits(
    count: int,
    point: NDArray[np.float64],
    m: int,
    rel: NDArray[np.float64],
    radius: NDArray[np.float64],
    margin: float,
) -> int:
    """Add points by which one leaves the discs around the start, or comes to the goal between discs; returns how many there are.

    From between discs leads a cone of directions in which one comes nearer to none of them, often too narrow to meet a corner.
    Each of its edges is at right angles to the direction of a disc.
    """
    for end in range(_GOAL + 1):
        for i in range(m):
            away_x, away_y = point[end, 0] - rel[i, 0], point[end, 1] - rel[i, 1]
            centre = max(length(away_x, away_y), 1e-9)
            if centre > radius[i] + margin + _WIDE_M:
                continue
            for exit_m in _EXITS_M:
                x, y = point[end, 0] - exit_m * away_y / centre, point[end, 1] + exit_m * away_x / centre
                if _is_clear(x, y, m, rel, radius, margin):
                    point[count, 0], point[count, 1] = x, y
                    count += 1
    return count


@allocating_kernel
def next_corner(
    goal_x: float,
    goal_y: float,
    m: int,
    rel: NDArray[np.float64],
    radius: NDArray[np.float64],
    margin: float,
    exits: bool,
) -> tuple[int, float, float]:
    """The first corner of the shortest way to the goal, all relative to me [m]: (corners on the way, x, y).

    ``rel`` (M, 2): centres [m], ``radius`` (M,) [m] of the first ``m`` obstacles, whose surfaces are passed at ``margin`` [m].
    With ``exits``, for who stands still: ways out of the margins around me, or into those around the goal, are tried as well.
    0 corners: the straight way is free, and (x, y) is the goal; -1: there is no way.
    """
    point = np.empty((2 + m * (_CORNERS + 2 * len(_EXITS_M)), 2))
    point[_START, 0], point[_START, 1] = 0.0, 0.0
    point[_GOAL, 0], point[_GOAL, 1] = goal_x, goal_y
    # A millimetre would free the way through a gap too narrow for whoever stands a hand's breadth before its neck.
    leeway = 1e-6 if exits else 1e-3
    if _is_free(_START, _GOAL, point, m, rel, radius, margin, leeway):
        return 0, goal_x, goal_y
    count = 2
    for i in range(m):
        outer = (radius[i] + margin) / cosine(math.pi / _CORNERS) + 1e-3
        for corner in range(_CORNERS):
            angle = 2.0 * math.pi * corner / _CORNERS
            x, y = rel[i, 0] + outer * cosine(angle), rel[i, 1] + outer * sine(angle)
            if _is_clear(x, y, m, rel, radius, margin):
                point[count, 0], point[count, 1] = x, y
                count += 1
    if exits:
        count = _add_exits(count, point, m, rel, radius, margin)
    way, before, closed = np.empty(count), np.empty(count, np.int64), np.empty(count, np.bool_)
    for i in range(count):
        way[i], before[i], closed[i] = math.inf, 0, False
    way[_START] = 0.0
    while True:
        here, best = -1, math.inf
        for i in range(count):
            if not closed[i]:
                whole = way[i] + length(goal_x - point[i, 0], goal_y - point[i, 1])
                if whole < best:
                    here, best = i, whole
        if here < 0:
            return -1, 0.0, 0.0
        if here == _GOAL:
            break
        closed[here] = True
        for i in range(count):
            if not closed[i]:
                whole = way[here] + length(point[i, 0] - point[here, 0], point[i, 1] - point[here, 1])
                if whole < way[i] and _is_free(here, i, point, m, rel, radius, margin, leeway):
                    way[i], before[i] = whole, here
    corners, first = 0, _GOAL
    while before[first] != _START:
        first = before[first]
        corners += 1
    return corners, point[first, 0], point[first, 1]


@inlined_kernel
def leave_pocket(
    wanted: Vector, row: int, rules: Rules, work: Work, sensed: Sensed, memory: Memory
) -> Vector:
    """The acceleration [m/s²] a drone wants, ``wanted`` where it gets along by itself.

    Keeps ``memory.stalled`` and ``memory.way``.
    """
    error = work.slot_error[row]
    (p_x, p_y), (v_x, v_y) = vector(sensed.position, row), vector(sensed.velocity, row)
    far = math.sqrt(error[0] * error[0] + error[1] * error[1])
    on_detour = memory.stalled[row] - STALLED_TICKS
    if on_detour < 0:
        closes = v_x * error[0] + v_y * error[1] > _CLOSING_MPS * far
        memory.stalled[row] = 0 if closes or far < _FAR_M else memory.stalled[row] + 1
        return wanted
    way = memory.way[row]
    x, y = way[0] - p_x, way[1] - p_y
    if on_detour % _PLAN_TICKS == 0 or (way[2] > 0.0 and x * x + y * y < _REACHED_M * _REACHED_M):
        m, rel, radius = memory.disc_count[row], memory.obstacle_rel[row], memory.obstacle_radius[row]
        kept = rules.limits.obstacle_clearance
        corners, x, y = next_corner(error[0], error[1], m, rel, radius, kept + _WIDE_M, False)
        if corners < 0:
            corners, x, y = next_corner(error[0], error[1], m, rel, radius, kept + _TIGHT_M, False)
        stands = v_x * v_x + v_y * v_y < _STANDING_MPS * _STANDING_MPS
        if corners < 0 or (corners == 0 and stands):
            corners, x, y = next_corner(error[0], error[1], m, rel, radius, kept + _TIGHT_M, True)
        way[0], way[1], way[2] = p_x + x, p_y + y, corners
    if way[2] < 0.0 or (way[2] == 0.0 and (far < _HOME_M or on_detour == 0)):
        memory.stalled[row] = 0
        return wanted
    memory.stalled[row] += 1
    speed = _AROUND_MPS
    if way[2] == 0.0:
        x, y = error[0], error[1]  # the slot moves
        vt_x, vt_y = vector(work.target_velocity, row)
        target_mps = math.sqrt(vt_x * vt_x + vt_y * vt_y)
        speed = max(_HOME_MPS, target_mps + _CATCH_UP_MPS)
    ahead = max(length(x, y), 1e-9)
    u_x, u_y = x / ahead, y / ahead
    apart_x, apart_y = agent_terms(neighbours_of(memory, row), (u_x, u_y), rules.gains)
    return _GAIN * (speed * u_x - v_x) + apart_x, _GAIN * (speed * u_y - v_y) + apart_y
