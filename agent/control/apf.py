"""The paper's artificial potential field (Sec. II-A), to the letter: three terms, each of them a few lines.

    a = a_form + a_obs + a_goal          the centralized expert; the weights w_f, w_o, w_g are in the gains
    a = a_obs + a_goal                   the safety controller: all that keeps the formation is taken away

    a_form   a pull towards the place that the leader sets; a Morse-type repulsion between drones; damping against the leader
    a_obs    each obstacle is a robot at the nearest point of its surface, which slides along with the drone and repels it
    a_goal   PD towards the virtual leader: the place of the own slot under it

Nothing tells a drone on which side to pass an obstacle, and nothing looks ahead: that is what the paper describes. It gives no
constants. These were searched on training maps (docs/paper.md).
"""

import math
from typing import NamedTuple

from agent.control.attraction import Aim, saturated
from agent.control.flocking import beta_velocity
from agent.control.gains import GAINS
from agent.control.surroundings import Discs, Neighbours
from protocols.arithmetic import exp
from protocols.dynamics import Vector
from protocols.kernels import inlined_kernel


class Apf(NamedTuple):
    """The constants of the three terms. Distances are centre to centre for drones, to the surface for obstacles."""

    contact_m: float = 0.5  #: m, distance that counts as a collision
    form_pull: float = 2.0  #: 1/s², towards the leader's place for me
    form_reach: float = 4.3  #: m, error beyond which that pull no longer grows
    form_damping: float = 0.22  #: 1/s, on the velocity relative to the leader's
    morse_strength: float = 1.5  #: m/s²
    morse_decay: float = 1.0  #: 1/m
    morse_range: float = 3.3  #: m, no repulsion beyond
    obstacle_push: float = 50.0  #: m/s² at contact, falling to 0 at the range as a square does
    obstacle_range: float = 4.6  #: m
    obstacle_wall: float = 4.5  #: m²/s², of what is added within 1 m of contact
    obstacle_damping: float = 3.15  #: 1/s at contact, on the velocity relative to its robot
    goal_pull: float = 2.95  #: 1/s², towards the place of the own slot
    goal_reach: float = 10.9  #: m, error beyond which that pull no longer grows
    goal_damping: float = 2.9  #: 1/s, on the velocity relative to the virtual leader's


APF = Apf()
_WALL_M, _LEAST_M = 1.0, 0.1  # how far from contact the wall begins, and where it grows no more


def apf_for(collision_m: float) -> Apf:
    """The constants of drones that collide at so much [m]: every range moves along with it."""
    farther = collision_m - GAINS.contact_m
    return APF._replace(
        contact_m=collision_m,
        morse_range=APF.morse_range + farther,
        obstacle_range=APF.obstacle_range + farther,
    )


@inlined_kernel
def formation_term(aim: Aim, leader_velocity: Vector, near: Neighbours, apf: Apf) -> Vector:
    """a_form [m/s²]; ``aim.chain_error``: the place that the leader sets for me, minus mine."""
    e_x, e_y = saturated(aim.chain_error[0], aim.chain_error[1], apf.form_reach)
    a_x = apf.form_pull * e_x + apf.form_damping * (leader_velocity[0] - aim.velocity[0])
    a_y = apf.form_pull * e_y + apf.form_damping * (leader_velocity[1] - aim.velocity[1])
    for j in range(near.size):
        r_x, r_y = near.rel[j, 0], near.rel[j, 1]
        d = math.sqrt(r_x * r_x + r_y * r_y)
        if 1e-6 < d < apf.morse_range:
            e = exp(-apf.morse_decay * (d - apf.morse_range))
            push = apf.morse_strength * (e * e - e) / d
            a_x -= push * r_x
            a_y -= push * r_y
    return a_x, a_y


@inlined_kernel
def obstacle_term(discs: Discs, velocity: Vector, apf: Apf) -> Vector:
    """a_obs [m/s²]: the robot of an obstacle is at the projection of the drone on its surface, and slides along with its
    ``velocity`` [m/s]: Olfati-Saber's beta-agent.

    It pushes from afar and hardly harder near by: so a drone is stopped well before two obstacles that leave no way between them,
    where both together still turn it aside like one, and not in the pocket between them, which holds it. Near contact a wall is
    added, and nobody drifts in.
    """
    a_x, a_y = 0.0, 0.0
    for i in range(discs.size):
        r_x, r_y, radius = discs.rel[i, 0], discs.rel[i, 1], discs.radius[i]
        centre = math.sqrt(r_x * r_x + r_y * r_y)
        d = centre - radius
        if centre < 1e-6 or d >= apf.obstacle_range:
            continue
        n_x, n_y = -r_x / centre, -r_y / centre
        d = max(d - apf.contact_m, 0.0)
        q = 1.0 - d / (apf.obstacle_range - apf.contact_m)
        wall = max(1.0 / (d + _LEAST_M) - 1.0 / (_WALL_M + _LEAST_M), 0.0)
        push = apf.obstacle_push * q * q + apf.obstacle_wall * wall
        w_x, w_y = beta_velocity(velocity, (n_x, n_y), radius / centre)
        follow = apf.obstacle_damping * q
        a_x += push * n_x + follow * w_x
        a_y += push * n_y + follow * w_y
    return a_x, a_y


@inlined_kernel
def goal_term(aim: Aim, apf: Apf) -> Vector:
    """a_goal [m/s²]."""
    e_x, e_y = saturated(aim.slot_error[0], aim.slot_error[1], apf.goal_reach)
    a_x = apf.goal_pull * e_x + apf.goal_damping * (aim.target_velocity[0] - aim.velocity[0])
    a_y = apf.goal_pull * e_y + apf.goal_damping * (aim.target_velocity[1] - aim.velocity[1])
    return a_x, a_y


@inlined_kernel
def safety_controller(aim: Aim, discs: Discs, apf: Apf) -> Vector:
    """a_obs + a_goal [m/s²], from what one drone sees."""
    (o_x, o_y), (g_x, g_y) = obstacle_term(discs, aim.velocity, apf), goal_term(aim, apf)
    return o_x + g_x, o_y + g_y


@inlined_kernel
def expert(aim: Aim, leader_velocity: Vector, near: Neighbours, discs: Discs, apf: Apf) -> Vector:
    """a_form + a_obs + a_goal [m/s²], not yet limited."""
    f_x, f_y = formation_term(aim, leader_velocity, near, apf)
    s_x, s_y = safety_controller(aim, discs, apf)
    return f_x + s_x, f_y + s_y
