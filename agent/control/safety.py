"""The safety filter: the acceleration nearest to the desired one that keeps room to brake before everything.

Last in the chain, every step, from local sensing only. For each neighbour and obstacle, with ``n`` the unit
vector from it to me, ``d`` the distance, ``v_n`` its rate of change and ``r`` the distance of the centres:

    h = sqrt(2 b (d - d_s)) + v_n >= 0        (the closing speed can still be braked away at b)
    n·a >= rho [-gamma h - b v_n / sqrt(2 b (d - d_s)) - v_tan²/r]      (h falls no faster than gamma h)

Each is a half-plane of accelerations. The filter solves  min |a - a_des|²  over |a| <= a_max and all
half-planes. Where they contradict each other, the half-planes of obstacles stay and the worst violation
among the agents' is made as small as possible; where even the obstacles' contradict, all give way alike.
Two agents share a burden (rho), an obstacle shares none.
"""

import math

import numpy as np

from agent.control.gains import SafetyLimits
from agent.control.halfplanes import least_violation, nearest_point
from agent.control.surroundings import Discs, Neighbours
from protocols.dynamics import Vector
from protocols.kernels import allocating_kernel, kernel


@kernel
def barrier_bound(
    d: float, v_n: float, swing: float, brake: float, clearance: float, share: float, limits: SafetyLimits
) -> float:
    """The least acceleration [m/s²] along ``n`` that the barrier allows, at most ``row_limit``.

    ``d`` [m]: distance (centre to centre, or from the surface), ``v_n`` [m/s]: its rate of change,
    ``swing`` [m/s²]: how fast that rate grows by passing sideways alone (square of the relative velocity
    across ``n`` over the centre distance).
    """
    stop_speed = math.sqrt(2.0 * brake * max(d - clearance, 0.0))
    bound = -limits.decay * (stop_speed + v_n) - brake * v_n / max(stop_speed, 0.3) - swing
    return min(share * bound, limits.row_limit)


@kernel
def _harmless_m(speed: float, brake: float, clearance: float, share: float, limits: SafetyLimits) -> float:
    """The distance [m] from which on a half-plane holds every acceleration there is: its bound is below -a_max.

    With ``speed`` [m/s] at least |w|, and  stop = speed + a_max/(rho gamma) + b/gamma:  -gamma (stop + v_n) is at most
    -a_max/rho - b, and  -b v_n/stop  at most b.
    """
    stop = speed + limits.max_acceleration / (share * limits.decay) + brake / limits.decay
    return clearance + stop * stop / (2.0 * brake)


@kernel
def _obstacle_row(
    r_x: float, r_y: float, radius: float, vx: float, vy: float, limits: SafetyLimits
) -> tuple[float, float, float]:
    """Half-plane ``(n_x, n_y, bound)`` of an obstacle whose centre is at ``r`` from me."""
    centre = max(math.sqrt(r_x * r_x + r_y * r_y), 1e-6)
    n_x = -r_x / centre
    n_y = -r_y / centre
    v_n = vx * n_x + vy * n_y
    swing = (vx * vx + vy * vy - v_n * v_n) / centre
    bound = barrier_bound(
        centre - radius, v_n, swing, limits.obstacle_brake, limits.obstacle_clearance, 1.0, limits
    )
    return n_x, n_y, bound


@kernel
def _agent_row(
    r_x: float, r_y: float, w_x: float, w_y: float, limits: SafetyLimits
) -> tuple[float, float, float]:
    """Half-plane ``(n_x, n_y, bound)`` of a neighbour at ``r`` from me that moves at ``w`` relative to me."""
    d = max(math.sqrt(r_x * r_x + r_y * r_y), 1e-6)
    n_x = -r_x / d
    n_y = -r_y / d
    v_n = -(w_x * n_x + w_y * n_y)
    swing = (w_x * w_x + w_y * w_y - v_n * v_n) / d
    bound = barrier_bound(
        d, v_n, swing, limits.agent_brake, limits.agent_clearance, limits.agent_share, limits
    )
    return n_x, n_y, bound


@allocating_kernel
def safety_filter(
    wanted: Vector, velocity: Vector, near: Neighbours, discs: Discs, limits: SafetyLimits
) -> Vector:
    """The safe acceleration [m/s²] nearest to the one ``wanted``; its length is within the limit. ``velocity``: own [m/s]."""
    (ax, ay), (vx, vy) = wanted, velocity
    k, rel, vel = near.size, near.rel, near.vel
    m, o_rel, o_radius = discs.size, discs.rel, discs.radius
    # The rows are filled in here, from scalar helpers: handing the arrays on to another kernel would count
    # references to each of them, which costs more than the whole filter. What is harmless gets no row.
    rows = np.empty((m + k, 3))
    count = 0
    harmless = _harmless_m(
        math.sqrt(vx * vx + vy * vy), limits.obstacle_brake, limits.obstacle_clearance, 1.0, limits
    )
    for i in range(m):
        far = harmless + o_radius[i]
        if o_rel[i, 0] * o_rel[i, 0] + o_rel[i, 1] * o_rel[i, 1] < far * far:
            n_x, n_y, bound = _obstacle_row(o_rel[i, 0], o_rel[i, 1], o_radius[i], vx, vy, limits)
            rows[count, 0] = n_x
            rows[count, 1] = n_y
            rows[count, 2] = bound
            count += 1
    obstacles = count
    for j in range(k):
        speed = 0.5 * (vel[j, 0] * vel[j, 0] + vel[j, 1] * vel[j, 1] + 1.0)  # no less, and no square root
        far = _harmless_m(speed, limits.agent_brake, limits.agent_clearance, limits.agent_share, limits)
        if rel[j, 0] * rel[j, 0] + rel[j, 1] * rel[j, 1] < far * far:
            n_x, n_y, bound = _agent_row(rel[j, 0], rel[j, 1], vel[j, 0], vel[j, 1], limits)
            rows[count, 0] = n_x
            rows[count, 1] = n_y
            rows[count, 2] = bound
            count += 1

    radius = limits.max_acceleration
    failed, x, y = nearest_point(count, rows, radius, ax, ay, False)
    if failed == count:
        return x, y
    # Contradicting obstacles cannot all be kept: then no row is hard.
    hard = obstacles if failed >= obstacles else 0
    return least_violation(failed, count, hard, rows, radius, x, y)
