"""Attraction: towards the chain target and the slot target, and the heading an agent wants to take.

Two spring-dampers whose springs stop growing at their reach, so that a far target does not drown every
other term:

    a = kf sat(e_c, sf) + kfv (v_t - v) + kg sat(e_g, sg) + kgv (v_t - v)

The heading is the direction of the weighted error, looked at from a few metres ahead along the target's
motion: an agent that sits in its slot still "goes somewhere" and can tell whether an obstacle will be in
its way.
"""

import math
from typing import NamedTuple

from agent.control.gains import Gains
from protocols.dynamics import Vector
from protocols.kernels import inlined_kernel


class Aim(NamedTuple):
    """Where one drone wants to be: errors are target minus own position [m]; its own velocity and the target's [m/s]."""

    chain_error: Vector
    slot_error: Vector
    velocity: Vector
    target_velocity: Vector


@inlined_kernel
def saturated(x: float, y: float, reach: float) -> tuple[float, float]:
    """``(x, y)`` shortened to length ``reach`` where it is longer."""
    length = math.sqrt(x * x + y * y)
    if length <= reach:
        return x, y
    scale = reach / length
    return x * scale, y * scale


@inlined_kernel
def attraction(aim: Aim, gains: Gains) -> Vector:
    """Acceleration [m/s²] towards the chain target and the slot target."""
    chain_x, chain_y = saturated(aim.chain_error[0], aim.chain_error[1], gains.chain_reach)
    slot_x, slot_y = saturated(aim.slot_error[0], aim.slot_error[1], gains.slot_reach)
    (v_x, v_y), (vt_x, vt_y) = aim.velocity, aim.target_velocity
    damping = gains.chain_damping + gains.slot_damping
    a_x = gains.chain_pull * chain_x + gains.slot_pull * slot_x + damping * (vt_x - v_x)
    a_y = gains.chain_pull * chain_y + gains.slot_pull * slot_y + damping * (vt_y - v_y)
    return a_x, a_y


@inlined_kernel
def heading(aim: Aim, gains: Gains) -> Vector:
    """Unit vector of where the agent wants to go; (1, 0) where the error cancels the look-ahead exactly."""
    (ec_x, ec_y), (eg_x, eg_y), (vt_x, vt_y) = aim.chain_error, aim.slot_error, aim.target_velocity
    total = gains.chain_pull + gains.slot_pull
    u_x = (gains.chain_pull * ec_x + gains.slot_pull * eg_x) / total
    u_y = (gains.chain_pull * ec_y + gains.slot_pull * eg_y) / total
    speed = math.sqrt(vt_x * vt_x + vt_y * vt_y)
    if speed > 1e-9:
        u_x += gains.look_ahead * vt_x / speed
        u_y += gains.look_ahead * vt_y / speed
    length = math.sqrt(u_x * u_x + u_y * u_y)
    if length < 1e-9:
        return 1.0, 0.0
    return u_x / length, u_y / length
