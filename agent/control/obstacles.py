"""Passing obstacles: repulsion, braking, a barrier near contact, and the way around.

A push alone leaves an agent in front of an obstacle where push and attraction balance. So:

- Obstacles whose gap is too narrow to count on are one cluster.
- A cluster that reaches into the lane along the heading is passed on the side where it reaches less far; the whole
  cluster on one side, and the side is remembered until its obstacles are out of range. Choosing per obstacle sends an agent
  left around one disc and right around the next, into the pocket between them.
- A blocking obstacle adds an acceleration along its surface towards that side, and takes away part of the attraction
  that points into it.

``n`` is the outward unit normal (obstacle to agent), ``d`` the distance from the surface, and
``q = (range - d)/(range - 0.5)`` grows from 0 at the range to 1 at contact distance.
"""

import math

import numpy as np
from numpy.typing import NDArray

from agent.control.gains import Gains
from protocols.kernels import kernel

CONTACT = 0.5  #: m from the surface, the distance that counts as a collision
LEFT = 1
RIGHT = -1


@kernel
def cluster_labels(
    m: int, rel: NDArray[np.float64], radius: NDArray[np.float64], gap: float
) -> NDArray[np.int64]:
    """(m,) cluster number of each obstacle: same number where gaps below ``gap`` [m] link them, transitively."""
    label = np.empty(m, np.int64)
    for i in range(m):
        label[i] = i
        for j in range(i):
            reach = radius[i] + radius[j] + gap
            dx = rel[i, 0] - rel[j, 0]
            dy = rel[i, 1] - rel[j, 1]
            if dx * dx + dy * dy < reach * reach and label[j] != label[i]:
                old = label[i]
                new = label[j]
                for other in range(i + 1):
                    if label[other] == old:
                        label[other] = new
    return label


@kernel
def choose_sides(
    m: int,
    rel: NDArray[np.float64],
    radius: NDArray[np.float64],
    side: NDArray[np.int8],
    u_x: float,
    u_y: float,
    gains: Gains,
) -> None:
    """Update ``side`` (M,) in place: LEFT or RIGHT for every obstacle of a cluster that blocks the heading, else 0.

    ``rel`` (M, 2): centres minus me [m]; ``radius`` (M,) [m]; ``u``: heading. A side already remembered stays for as long
    as the obstacle is in memory range, and its cluster takes it over.
    """
    forget = gains.obstacle_range + gains.keep_side
    label = cluster_labels(m, rel, radius, gains.cluster_gap)
    for c in range(m):
        low = math.inf
        high = -math.inf
        ahead = False
        nearest = math.inf
        nearest_sided = math.inf
        remembered = 0
        for i in range(m):
            if label[i] != c:
                continue
            d = math.sqrt(rel[i, 0] * rel[i, 0] + rel[i, 1] * rel[i, 1]) - radius[i]
            if side[i] != 0 and d < nearest_sided and d < forget:
                nearest_sided = d
                remembered = side[i]
            nearest = min(nearest, d)
            along = u_x * rel[i, 0] + u_y * rel[i, 1]
            if gains.x_ext > 0.5 and along + radius[i] < 0.0:
                continue
            across = u_x * rel[i, 1] - u_y * rel[i, 0]
            low = min(low, across - radius[i])
            high = max(high, across + radius[i])
            if along > 0.0:
                ahead = True
        blocks = ahead and high > -gains.lane and low < gains.lane
        chosen = remembered
        if gains.x_block > 0.5 and not blocks:
            chosen = 0
        if blocks and nearest < gains.obstacle_range + (gains.keep_side if remembered != 0 else 0.0):
            lean = -(high + low) + gains.stick * remembered  # positive: left is shorter
            chosen = LEFT if lean > 0.0 else RIGHT
        for i in range(m):
            if label[i] == c:
                d = math.sqrt(rel[i, 0] * rel[i, 0] + rel[i, 1] * rel[i, 1]) - radius[i]
                side[i] = chosen if d < forget else 0


@kernel
def obstacle_terms(
    m: int,
    rel: NDArray[np.float64],
    radius: NDArray[np.float64],
    side: NDArray[np.int8],
    v_x: float,
    v_y: float,
    u_x: float,
    u_y: float,
    pull_x: float,
    pull_y: float,
    gains: Gains,
) -> tuple[float, float]:
    """Acceleration [m/s²] because of the first ``m`` obstacles, to be added to the attraction ``pull`` [m/s²].

    ``rel`` (M, 2): centres minus me [m]; ``radius`` (M,) [m]; ``side`` (M,): memory, updated in place; ``v``: own
    velocity [m/s]; ``u``: heading.
    """
    forget = gains.obstacle_range + gains.keep_side
    in_reach = False
    for i in range(m):
        reach = forget + radius[i]
        if rel[i, 0] * rel[i, 0] + rel[i, 1] * rel[i, 1] < reach * reach:
            in_reach = True
    if not in_reach:
        for i in range(m):
            side[i] = 0
        return 0.0, 0.0

    choose_sides(m, rel, radius, side, u_x, u_y, gains)
    a_x = 0.0
    a_y = 0.0
    for i in range(m):
        centre = math.sqrt(rel[i, 0] * rel[i, 0] + rel[i, 1] * rel[i, 1])
        d = centre - radius[i]
        if d >= gains.obstacle_range or centre < 1e-6:
            continue
        n_x = -rel[i, 0] / centre
        n_y = -rel[i, 1] / centre
        q = (gains.obstacle_range - d) / (gains.obstacle_range - CONTACT)
        push = gains.obstacle_repulsion * q * q
        closing = -(v_x * n_x + v_y * n_y)
        if closing > 0.0:
            push += gains.obstacle_brake * closing * closing / (2.0 * max(d - CONTACT, 0.1))
        if d < gains.obstacle_barrier_range:
            push += gains.obstacle_barrier * (gains.obstacle_barrier_range - d) / max(d - CONTACT + 0.01, 0.01)
        blocking = side[i] != 0 and rel[i, 0] * u_x + rel[i, 1] * u_y > 0.0
        if blocking:
            inward = pull_x * n_x + pull_y * n_y
            if inward < 0.0:
                push -= gains.release * min(1.0, q) * inward
            along = -side[i] * gains.around * q
            a_x -= along * n_y
            a_y += along * n_x
        a_x += push * n_x
        a_y += push * n_y
    return a_x, a_y
