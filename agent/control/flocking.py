"""Olfati-Saber's flocking: the three terms of Algorithm 3 of "Flocking for Multi-Agent Dynamic Systems" (IEEE TAC, 2006).

    u = u_alpha + u_beta + u_gamma

- alpha: neighbours keep the distance of the lattice and agree on a velocity.
- beta: every near obstacle is a neighbour too, that slides along its surface at the point nearest to me.
- gamma: one virtual leader pulls everybody, with a force that does not grow with the distance.

Distances are measured in the sigma-norm ``|z|_s = (sqrt(1 + eps |z|^2) - 1) / eps``, which is smooth at 0, and every
interaction is faded out to nothing at its range by the bump function ``rho_h``.
"""

import math
from typing import NamedTuple

from agent.control.gains import GAINS
from agent.control.surroundings import Discs, Neighbours
from protocols.arithmetic import cosine
from protocols.dynamics import Vector
from protocols.kernels import inlined_kernel
from protocols.mission.document import Mission


class Flocking(NamedTuple):
    """Constants of the three terms, with the names they have in Olfati-Saber's article.

    Both c1 of alpha and of beta act along the gradient of the sigma-norm, which is at most ``1 / sqrt(eps)`` long. Found by a
    search (CMA-ES, 20 training maps a step, successes with and without the safety filter), except d, r and b.
    """

    spacing_m: float  #: d, distance that neighbours keep
    range_m: float  #: r, distance up to which drones are neighbours
    alpha_pull: float = 35.0  #: 1/m, c1 of alpha
    alpha_consensus: float = 2.1  #: 1/s, c2 of alpha, on the velocity relative to each neighbour
    attraction_limit: float = 2.34  #: a, m/s^2, towards a neighbour that is too far
    repulsion_limit: float = 5.0  #: b >= a, m/s^2, away from one that is too near
    alpha_fade: float = (
        0.038  #: h, share of the range (in the sigma-norm) within which neighbours count fully
    )
    beta_push: float = 193.0  #: 1/s^2, c1 of beta
    beta_consensus: float = 0.045  #: 1/s, c2 of beta, on the velocity relative to the sliding point
    beta_range_m: float = 2.57  #: d', distance from the surface up to which obstacles count
    beta_fade: float = 0.035  #: h of beta
    gamma_pull: float = 0.001  #: m/s^2, c1 of gamma, towards the virtual leader
    gamma_damping: float = 0.02  #: 1/s, c2 of gamma, on the velocity relative to the virtual leader's
    epsilon: float = 59.0  #: 1/m^2, of the sigma-norm


def flocking_for(mission: Mission) -> Flocking:
    """The constants for a mission: obstacles count the farther away, the farther away one collides with them."""
    farther = mission.limits.collision_m - GAINS.contact_m
    flocking = Flocking(mission.formation.spacing_m, mission.sensing.range_m)
    return flocking._replace(beta_range_m=flocking.beta_range_m + farther)


@inlined_kernel
def sigma_norm(length: float, epsilon: float) -> float:
    """``|z|_s`` of a vector of ``length`` [m]."""
    return (math.sqrt(1.0 + epsilon * length * length) - 1.0) / epsilon


@inlined_kernel
def bump(share: float, full: float) -> float:
    """``rho_h``: 1 up to ``full`` = h, from there down to 0 at 1, smoothly."""
    if share < full:
        return 1.0
    if share >= 1.0:
        return 0.0
    return 0.5 * (1.0 + cosine(math.pi * (share - full) / (1.0 - full)))


@inlined_kernel
def sigmoid(z: float) -> float:
    """``sigma_1``: z / sqrt(1 + z^2)."""
    return z / math.sqrt(1.0 + z * z)


@inlined_kernel
def alpha_term(r_x: float, r_y: float, w_x: float, w_y: float, gains: Flocking) -> tuple[float, float]:
    """Acceleration [m/s^2] because of one neighbour.

    ``r``: its position minus mine [m]; ``w``: its velocity minus mine [m/s].
    """
    d = math.sqrt(r_x * r_x + r_y * r_y)
    z = sigma_norm(d, gains.epsilon)
    weight = bump(z / sigma_norm(gains.range_m, gains.epsilon), gains.alpha_fade)
    if weight == 0.0:
        return 0.0, 0.0
    a, b = gains.attraction_limit, gains.repulsion_limit
    c = abs(a - b) / math.sqrt(4.0 * a * b)
    action = 0.5 * ((a + b) * sigmoid(z - sigma_norm(gains.spacing_m, gains.epsilon) + c) + a - b)
    pull = gains.alpha_pull * weight * action / math.sqrt(1.0 + gains.epsilon * d * d)
    follow = gains.alpha_consensus * weight
    return pull * r_x + follow * w_x, pull * r_y + follow * w_y


@inlined_kernel
def beta_velocity(velocity: Vector, normal: Vector, share: float) -> Vector:
    """How the beta-agent of a disc moves, minus ``velocity``, which is mine [m/s]: with the part of it along the surface,
    shortened by ``share``, radius over distance. ``normal``: of unit length, towards the centre or away from it."""
    (v_x, v_y), (n_x, n_y) = velocity, normal
    inward = v_x * n_x + v_y * n_y
    return share * (v_x - inward * n_x) - v_x, share * (v_y - inward * n_y) - v_y


@inlined_kernel
def beta_term(
    r_x: float, r_y: float, radius: float, v_x: float, v_y: float, gains: Flocking
) -> tuple[float, float]:
    """Acceleration [m/s^2] because of one disc, centre at ``r`` from me [m]; ``v``: own velocity [m/s].

    Its beta-agent is the point of the surface nearest to me, which slides along with me (`beta_velocity`).
    """
    centre = math.sqrt(r_x * r_x + r_y * r_y)
    if centre < 1e-6:
        return 0.0, 0.0
    d = max(centre - radius, 0.0)
    reach = sigma_norm(gains.beta_range_m, gains.epsilon)
    z = sigma_norm(d, gains.epsilon)
    weight = bump(z / reach, gains.beta_fade)
    if weight == 0.0:
        return 0.0, 0.0
    n_x, n_y = r_x / centre, r_y / centre
    w_x, w_y = beta_velocity((v_x, v_y), (n_x, n_y), radius / centre)
    push = gains.beta_push * weight * (sigmoid(z - reach) - 1.0) * d / math.sqrt(1.0 + gains.epsilon * d * d)
    follow = gains.beta_consensus * weight
    return push * n_x + follow * w_x, push * n_y + follow * w_y


@inlined_kernel
def gamma_term(r_x: float, r_y: float, w_x: float, w_y: float, gains: Flocking) -> tuple[float, float]:
    """Acceleration [m/s^2] because of the virtual leader: ``r``, ``w`` its position [m] and velocity [m/s] minus mine."""
    pull = gains.gamma_pull / math.sqrt(1.0 + r_x * r_x + r_y * r_y)
    return pull * r_x + gains.gamma_damping * w_x, pull * r_y + gains.gamma_damping * w_y


@inlined_kernel
def flocking(
    near: Neighbours, discs: Discs, v: Vector, leader: Vector, leader_velocity: Vector, gains: Flocking
) -> Vector:
    """The sum of all terms [m/s^2] for one drone.

    ``v``: own velocity [m/s]; ``leader``: the virtual leader minus me [m], ``leader_velocity``: its velocity [m/s].
    """
    v_x, v_y = v
    a_x, a_y = gamma_term(leader[0], leader[1], leader_velocity[0] - v_x, leader_velocity[1] - v_y, gains)
    for j in range(near.size):
        b_x, b_y = alpha_term(near.rel[j, 0], near.rel[j, 1], near.vel[j, 0], near.vel[j, 1], gains)
        a_x += b_x
        a_y += b_y
    for i in range(discs.size):
        b_x, b_y = beta_term(discs.rel[i, 0], discs.rel[i, 1], discs.radius[i], v_x, v_y, gains)
        a_x += b_x
        a_y += b_y
    return a_x, a_y
