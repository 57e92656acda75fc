"""Passing obstacles: repulsion, braking, a barrier near contact, and the way around.

A push alone leaves an agent in front of an obstacle where push and attraction balance. So:

- Obstacles whose gap is too narrow to count on are one cluster.
- A cluster that reaches into the lane along the heading is passed on the side where it reaches less far,
  the whole cluster on one side: choosing per obstacle sends an agent left around one disc and right around
  the next, into the pocket between them. The side is remembered while the obstacles are near, and changed
  only when the other one is clearly shorter. (An agent that forgets obstacles it no longer sees must not
  change at all: what is still in sight then says too little about which way is shorter.)
- A blocking obstacle adds an acceleration along its surface towards that side, and takes away part of the
  attraction that points into it.

``n`` is the outward unit normal (obstacle to agent), ``d`` the distance from the surface, and
``q = (range - d)/(range - contact)`` grows from 0 at the range to 1 at contact distance.
"""

import math

from agent.control.gains import Gains
from agent.control.surroundings import Discs
from protocols.dynamics import Vector, vector
from protocols.kernels import inlined_kernel

LEFT = 1
RIGHT = -1


@inlined_kernel
def cluster_of(first: int, discs: Discs, gap: float) -> int:
    """Obstacles (bit i: obstacle i) that gaps below ``gap`` [m] link to obstacle ``first``, with itself."""
    m, rel, radius = discs.size, discs.rel, discs.radius
    cluster = 1 << first
    fresh = cluster
    while fresh != 0:
        found = 0
        for i in range(m):
            if (fresh >> i) & 1 == 0:
                continue
            for j in range(m):
                if (cluster >> j) & 1 == 0:
                    reach = radius[i] + radius[j] + gap
                    dx = rel[i, 0] - rel[j, 0]
                    dy = rel[i, 1] - rel[j, 1]
                    if dx * dx + dy * dy < reach * reach:
                        found |= 1 << j
        cluster |= found
        fresh = found
    return cluster


@inlined_kernel
def choose_side(cluster: int, discs: Discs, u: Vector, gains: Gains) -> int:
    """Side on which ``cluster`` is to be passed now; 0 where it leaves the lane along the heading ``u`` free.

    In ``discs.side``, a cluster takes over the side of its nearest member that has one, and obstacles out of memory range lose
    theirs.
    """
    m, rel, radius, side = discs.size, discs.rel, discs.radius, discs.side
    u_x, u_y = u
    forget = gains.obstacle_range + gains.keep_side
    low = math.inf
    high = -math.inf
    ahead = False
    nearest = math.inf
    nearest_decided = forget
    decided = 0
    for i in range(m):
        if (cluster >> i) & 1:
            across = u_x * rel[i, 1] - u_y * rel[i, 0]
            low = min(low, across - radius[i])
            high = max(high, across + radius[i])
            ahead = ahead or u_x * rel[i, 0] + u_y * rel[i, 1] > 0.0
            d = math.sqrt(rel[i, 0] * rel[i, 0] + rel[i, 1] * rel[i, 1]) - radius[i]
            nearest = min(nearest, d)
            if d >= forget:
                side[i] = 0
            elif side[i] != 0 and d < nearest_decided:
                nearest_decided = d
                decided = side[i]
    blocks = ahead and high > -gains.lane and low < gains.lane and nearest < gains.obstacle_range
    if blocks:
        # Passing left means going `high` far aside, passing right `-low`.
        margin = gains.side_loyalty * decided if decided != 0 else 0.0
        decided = LEFT if high + low < margin else RIGHT
    for i in range(m):
        if (cluster >> i) & 1:
            d = math.sqrt(rel[i, 0] * rel[i, 0] + rel[i, 1] * rel[i, 1]) - radius[i]
            if d < forget:
                side[i] = decided
    return decided if blocks else 0


@inlined_kernel
def obstacle_term(
    r: Vector, radius: float, passing: int, v: Vector, u: Vector, pull: Vector, gains: Gains
) -> Vector:
    """Acceleration [m/s²] because of one obstacle, centre at ``r`` from me [m], to be passed on ``passing``."""
    (r_x, r_y), (v_x, v_y), (u_x, u_y), (pull_x, pull_y) = r, v, u, pull
    centre = math.sqrt(r_x * r_x + r_y * r_y)
    d = centre - radius
    if d >= gains.obstacle_range or centre < 1e-6:
        return 0.0, 0.0
    n_x = -r_x / centre
    n_y = -r_y / centre
    q = (gains.obstacle_range - d) / (gains.obstacle_range - gains.contact_m)
    push = gains.obstacle_repulsion * q * q
    closing = -(v_x * n_x + v_y * n_y)
    if closing > 0.0:
        push += gains.obstacle_brake * closing * closing / (2.0 * max(d - gains.contact_m, 0.1))
    if d < gains.obstacle_barrier_range:
        push += (
            gains.obstacle_barrier
            * (gains.obstacle_barrier_range - d)
            / max(d - gains.contact_m + 0.01, 0.01)
        )
    along = 0.0
    if passing != 0 and r_x * u_x + r_y * u_y > 0.0:
        inward = pull_x * n_x + pull_y * n_y
        if inward < 0.0:
            push -= gains.release * min(1.0, q) * inward
        along = -passing * gains.around * q
    return push * n_x - along * n_y, push * n_y + along * n_x


@inlined_kernel
def obstacle_terms(discs: Discs, v: Vector, u: Vector, pull: Vector, gains: Gains) -> Vector:
    """Acceleration [m/s²] because of all obstacles, to be added to the attraction ``pull`` [m/s²].

    ``v``: own velocity [m/s]; ``u``: heading. ``discs.side`` is updated.
    """
    m, rel, radius, side = discs.size, discs.rel, discs.radius, discs.side
    memory = gains.obstacle_range + gains.keep_side
    in_reach = False
    for i in range(m):
        reach = memory + radius[i]
        if rel[i, 0] * rel[i, 0] + rel[i, 1] * rel[i, 1] < reach * reach:
            in_reach = True
        else:
            side[i] = 0
    a_x = 0.0
    a_y = 0.0
    if not in_reach:
        return a_x, a_y
    done = 0
    for first in range(m):
        if (done >> first) & 1:
            continue
        cluster = cluster_of(first, discs, gains.cluster_gap)
        done |= cluster
        passing = choose_side(cluster, discs, u, gains)
        for i in range(m):
            if (cluster >> i) & 1:
                b_x, b_y = obstacle_term(vector(rel, i), radius[i], passing, v, u, pull, gains)
                a_x += b_x
                a_y += b_y
    return a_x, a_y
