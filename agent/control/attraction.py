"""Attraction: towards the chain target and the slot target, and the heading an agent wants to take.

Two spring-dampers whose springs stop growing at their reach, so that a far target does not drown every
other term:

    a = kf sat(e_c, sf) + kfv (v_t - v) + kg sat(e_g, sg) + kgv (v_t - v)

The heading is the direction of the weighted error, looked at from a few metres ahead along the target's
motion: an agent that sits in its slot still "goes somewhere" and can tell whether an obstacle will be in
its way.
"""

import math

from agent.control.gains import Gains
from protocols.kernels import inlined_kernel


@inlined_kernel
def saturated(x: float, y: float, reach: float) -> tuple[float, float]:
    """``(x, y)`` shortened to length ``reach`` where it is longer."""
    length = math.sqrt(x * x + y * y)
    if length <= reach:
        return x, y
    scale = reach / length
    return x * scale, y * scale


@inlined_kernel
def attraction(
    ec_x: float,
    ec_y: float,
    eg_x: float,
    eg_y: float,
    v_x: float,
    v_y: float,
    vt_x: float,
    vt_y: float,
    gains: Gains,
) -> tuple[float, float]:
    """Acceleration [m/s²] towards the targets at ``ec``, ``eg`` [m] from me, both moving at ``vt`` [m/s]."""
    chain_x, chain_y = saturated(ec_x, ec_y, gains.chain_reach)
    slot_x, slot_y = saturated(eg_x, eg_y, gains.slot_reach)
    damping = gains.chain_damping + gains.slot_damping
    a_x = gains.chain_pull * chain_x + gains.slot_pull * slot_x + damping * (vt_x - v_x)
    a_y = gains.chain_pull * chain_y + gains.slot_pull * slot_y + damping * (vt_y - v_y)
    return a_x, a_y


@inlined_kernel
def heading(
    ec_x: float, ec_y: float, eg_x: float, eg_y: float, vt_x: float, vt_y: float, gains: Gains
) -> tuple[float, float]:
    """Unit vector of where the agent wants to go; (1, 0) where the error cancels the look-ahead exactly."""
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
