"""The safety filter: the acceleration nearest to the desired one that keeps braking distance to everything near.

Last in the chain, every step, from local sensing only. For each neighbour and obstacle, with ``n`` the unit vector from it
to me, ``d`` the distance, ``v_n`` its rate of change and ``r`` the distance of the centres:

    h = sqrt(2 b (d - d_s)) + v_n >= 0           the closing speed can still be braked away at b
    n·a >= rho [-gamma h - b v_n / sqrt(2 b (d - d_s)) - v_tan²/r]     so that h does not fall faster than gamma h

Each is a half-plane of accelerations. The filter solves  min |a - a_des|²  over |a| <= a_max and all half-planes (ORCA's
second linear program). Where they contradict each other, the half-planes of obstacles stay and the worst violation
among the agents' is made as small as possible (ORCA's third); where even the obstacles' contradict, all give way alike.
Two agents share a burden (rho), an obstacle shares none.
"""

import math

import numpy as np
from numpy.typing import NDArray

from agent.control.gains import SafetyLimits
from protocols.kernels import kernel

_PARALLEL = 1e-9
_SLACK = 1e-9


@kernel
def barrier_bound(
    d: float, v_n: float, swing: float, brake: float, clearance: float, share: float, limits: SafetyLimits
) -> float:
    """The least acceleration [m/s²] along ``n`` that the barrier allows, at most ``row_limit``.

    ``d`` [m]: distance (centre to centre, or from the surface), ``v_n`` [m/s]: its rate of change, ``swing`` [m/s²]: how
    fast that rate grows by passing sideways alone (square of the relative velocity across ``n`` over the centre distance).
    """
    stop_speed = math.sqrt(2.0 * brake * max(d - clearance, 0.0))
    bound = -limits.decay * (stop_speed + v_n) - brake * v_n / max(stop_speed, 0.3) - swing
    return min(share * bound, limits.row_limit)


@kernel
def _on_line(
    i: int,
    rows: NDArray[np.float64],
    radius: float,
    goal_x: float,
    goal_y: float,
    farthest: bool,
) -> tuple[bool, float, float]:
    """Best point on the edge of row ``i`` within the ball and the rows before it (ORCA's first program).

    Best is nearest to ``goal``, or farthest along it. False where there is no such point.
    """
    n_x = rows[i, 0]
    n_y = rows[i, 1]
    bound = rows[i, 2]
    room = radius * radius - bound * bound
    if room < 0.0:
        return False, 0.0, 0.0
    high = math.sqrt(room)
    low = -high
    for j in range(i):
        slope = rows[j, 0] * n_y - rows[j, 1] * n_x
        lack = rows[j, 2] - bound * (rows[j, 0] * n_x + rows[j, 1] * n_y)
        if abs(slope) <= _PARALLEL:
            if lack > _SLACK:
                return False, 0.0, 0.0
        elif slope > 0.0:
            low = max(low, lack / slope)
        else:
            high = min(high, lack / slope)
        if low > high:
            return False, 0.0, 0.0
    t = goal_x * n_y - goal_y * n_x
    if farthest:
        t = high if t > 0.0 else low
    else:
        t = min(max(t, low), high)
    return True, bound * n_x + t * n_y, bound * n_y - t * n_x


@kernel
def _nearest(
    count: int,
    rows: NDArray[np.float64],
    radius: float,
    goal_x: float,
    goal_y: float,
    farthest: bool,
) -> tuple[int, float, float]:
    """Best point within the ball and all rows (ORCA's second program): first row that failed (or ``count``), point."""
    x = goal_x
    y = goal_y
    length = math.sqrt(x * x + y * y)
    if farthest or length > radius:
        x *= radius / length
        y *= radius / length
    for i in range(count):
        if rows[i, 0] * x + rows[i, 1] * y < rows[i, 2] - _SLACK:
            found, new_x, new_y = _on_line(i, rows, radius, goal_x, goal_y, farthest)
            if not found:
                return i, x, y
            x = new_x
            y = new_y
    return count, x, y


@kernel
def _least_violation(
    begin: int,
    count: int,
    hard: int,
    rows: NDArray[np.float64],
    radius: float,
    x: float,
    y: float,
) -> tuple[float, float]:
    """Point that keeps the first ``hard`` rows and whose worst violation of the rest is least (ORCA's third program).

    ``x, y`` keeps the rows before ``begin``. The points where row j is violated no more than row i are again a half-plane.
    """
    worst = 0.0
    inner = np.empty((count, 3))
    for i in range(begin, count):
        if rows[i, 2] - rows[i, 0] * x - rows[i, 1] * y <= worst + _SLACK:
            continue
        size = hard
        for j in range(hard):
            for c in range(3):
                inner[j, c] = rows[j, c]
        for j in range(hard, i):
            n_x = rows[j, 0] - rows[i, 0]
            n_y = rows[j, 1] - rows[i, 1]
            length = math.sqrt(n_x * n_x + n_y * n_y)
            if length > 1e-6:
                inner[size, 0] = n_x / length
                inner[size, 1] = n_y / length
                inner[size, 2] = (rows[j, 2] - rows[i, 2]) / length
                size += 1
        done, new_x, new_y = _nearest(size, inner, radius, rows[i, 0], rows[i, 1], True)
        if done == size:
            x = new_x
            y = new_y
        worst = rows[i, 2] - rows[i, 0] * x - rows[i, 1] * y
    return x, y


@kernel
def safety_filter(
    ax: float,
    ay: float,
    vx: float,
    vy: float,
    k: int,
    rel: NDArray[np.float64],
    vel: NDArray[np.float64],
    m: int,
    o_rel: NDArray[np.float64],
    o_radius: NDArray[np.float64],
    limits: SafetyLimits,
) -> tuple[float, float]:
    """The safe acceleration [m/s²] nearest to the desired ``(ax, ay)``.

    ``v``: own velocity [m/s]; ``rel`` [m], ``vel`` [m/s] (K, 2): neighbours minus me, first ``k`` rows; ``o_rel`` (M, 2):
    obstacle centres minus me [m], ``o_radius`` (M,) [m], first ``m`` rows. Length never exceeds ``max_acceleration``.
    """
    radius = limits.max_acceleration
    rows = np.empty((k + m, 3))
    count = 0
    for i in range(m):
        centre = math.sqrt(o_rel[i, 0] * o_rel[i, 0] + o_rel[i, 1] * o_rel[i, 1])
        if centre < 1e-6:
            continue
        n_x = -o_rel[i, 0] / centre
        n_y = -o_rel[i, 1] / centre
        v_n = vx * n_x + vy * n_y
        swing = (vx * vx + vy * vy - v_n * v_n) / centre
        bound = barrier_bound(
            centre - o_radius[i], v_n, swing, limits.obstacle_brake, limits.obstacle_clearance, 1.0, limits
        )
        if bound > -radius:
            rows[count, 0] = n_x
            rows[count, 1] = n_y
            rows[count, 2] = bound
            count += 1
    hard = count
    for j in range(k):
        d = math.sqrt(rel[j, 0] * rel[j, 0] + rel[j, 1] * rel[j, 1])
        if d < 1e-6:
            continue
        n_x = -rel[j, 0] / d
        n_y = -rel[j, 1] / d
        v_n = -(vel[j, 0] * n_x + vel[j, 1] * n_y)
        swing = (vel[j, 0] * vel[j, 0] + vel[j, 1] * vel[j, 1] - v_n * v_n) / d
        bound = barrier_bound(
            d, v_n, swing, limits.agent_brake, limits.agent_clearance, limits.agent_share, limits
        )
        if bound > -radius:
            rows[count, 0] = n_x
            rows[count, 1] = n_y
            rows[count, 2] = bound
            count += 1

    failed, x, y = _nearest(count, rows, radius, ax, ay, False)
    if failed == count:
        return x, y
    if failed < hard:
        hard = 0
    return _least_violation(failed, count, hard, rows, radius, x, y)
