"""Flying a planned trajectory: one tick's acceleration from a plan made some ticks ago.

A plan is where the drone was and how it moved when it was made, p0 and v0, and for each tick h = 0 ... H-1 a displacement
d^h from flying on at v0 and an acceleration a^h:

    p_ref(h) = p0 + v0 h dt + d^{h-1}   (p0 at h = 0)        v_ref(h) = v0 + dt sum_{k<h} a^k

It is tracked smoothly or, as in the paper, by the acceleration that reaches the next point within one tick
(agent.control.tracking); near other things the reactive controller takes over (agent.control.fusion).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.control.apf import Apf, apf_for, safety_controller
from agent.control.attraction import Aim
from agent.control.fusion import apf_blend
from agent.control.gains import Gains, gains_for, reactive_part
from agent.control.surroundings import Discs, Neighbours
from agent.control.tracking import required_acceleration, smooth_acceleration
from agent.policy.analytic_kernel import analytic
from protocols.dynamics import TICK_S, Vector
from protocols.kernels import inlined_kernel
from protocols.mission.document import Mission


class Following(NamedTuple):
    """How plans are flown: by the paper's a_req or smoothly; the distance at which the blend begins [m], 0 for none; and what
    is blended in: the reactive part of the analytic controller, or with ``papers`` the paper's safety controller."""

    required: bool
    blend_radius_m: float
    reactive: Gains
    papers: bool
    apf: Apf


def following_of(mission: Mission) -> Following:
    """A mission as kernels need it."""
    trajectory = mission.trajectory
    return Following(
        required=trajectory.tracking == "required",
        blend_radius_m=trajectory.blend_radius_m if trajectory.blend else 0.0,
        reactive=reactive_part(gains_for(mission.limits.collision_m)),
        papers=trajectory.blend_with == "paper",
        apf=apf_for(mission.limits.collision_m),
    )


class Plan(NamedTuple):
    """One drone's plan over P ticks: start (4,) p0 [m] and v0 [m/s], displacement (P, 2) [m], acceleration (P, 2) [m/s²]."""

    start: NDArray[np.float64]
    displacement: NDArray[np.float32]
    acceleration: NDArray[np.float32]


@inlined_kernel
def track_row(age: int, plan: Plan, position: Vector, velocity: Vector, required: bool) -> Vector:
    """Acceleration [m/s²] that keeps a drone on a plan made ``age`` ticks ago, 0 <= age < P.

    ``position`` [m], ``velocity`` [m/s]: now.
    """
    start, displacement, acceleration = plan.start, plan.displacement, plan.acceleration
    p_x, p_y = start[0] - position[0], start[1] - position[1]
    if required:
        ahead = (age + 1) * TICK_S
        r_x = p_x + start[2] * ahead + displacement[age, 0]
        r_y = p_y + start[3] * ahead + displacement[age, 1]
        return required_acceleration(r_x, r_y, velocity[0], velocity[1], TICK_S)
    w_x, w_y = start[2] - velocity[0], start[3] - velocity[1]
    for step in range(age):
        w_x += float(acceleration[step, 0]) * TICK_S
        w_y += float(acceleration[step, 1]) * TICK_S
    if age > 0:
        p_x += start[2] * age * TICK_S + displacement[age - 1, 0]
        p_y += start[3] * age * TICK_S + displacement[age - 1, 1]
    return smooth_acceleration(p_x, p_y, w_x, w_y, acceleration[age, 0], acceleration[age, 1])


@inlined_kernel
def _nearest(near: Neighbours, discs: Discs) -> tuple[float, float]:
    """Distance [m] to the nearest agent and to the nearest obstacle's surface; inf where there is none."""
    k, rel = near.size, near.rel
    m, o_rel, o_radius = discs.size, discs.rel, discs.radius
    r_agent, r_obs = math.inf, math.inf
    for j in range(k):
        r_agent = min(r_agent, math.sqrt(rel[j, 0] * rel[j, 0] + rel[j, 1] * rel[j, 1]))
    for i in range(m):
        r_obs = min(r_obs, math.sqrt(o_rel[i, 0] * o_rel[i, 0] + o_rel[i, 1] * o_rel[i, 1]) - o_radius[i])
    return r_agent, r_obs


@inlined_kernel
def follow_row(
    age: int, plan: Plan, position: Vector, aim: Aim, near: Neighbours, discs: Discs, following: Following
) -> Vector:
    """Wanted acceleration [m/s²] of one drone that flies a plan made ``age`` ticks ago, not yet limited.

    ``position``: now [m]. ``discs.side`` is updated where the reactive controller counts, which looks at nothing but the slot.
    """
    a_x, a_y = track_row(age, plan, position, aim.velocity, following.required)
    r_agent, r_obs = _nearest(near, discs)
    if min(r_agent, r_obs) >= following.blend_radius_m:
        return a_x, a_y
    if following.papers:
        apf_x, apf_y = safety_controller(aim, discs, following.apf)
    else:
        apf_x, apf_y = analytic(aim, near, discs, following.reactive)
    return apf_blend(a_x, a_y, apf_x, apf_y, r_agent, r_obs, following.blend_radius_m)
