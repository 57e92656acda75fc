"""Keeping apart from other agents: what one neighbour adds to the acceleration.

- Morse repulsion below its range: ``A (E² - E) n`` with ``E = exp(-al (d - d0))``.
- Closest approach, while the two approach each other: push away from the point at which the other would
  pass, more the sooner, the faster and the closer that is; and brake along the line between them.
- Giving way: when the other is ahead and near, a step aside, to the same hand for everyone, so that two
  agents face to face pass each other instead of balancing.
- A barrier near contact, which a slow drift cannot creep through.

``n`` is the unit vector from the other to me. Every rule is local to a pair, so the sum over neighbours
does not depend on N.
"""

import math

from agent.control.gains import Gains
from agent.control.surroundings import Neighbours
from protocols.arithmetic import exp
from protocols.dynamics import Vector, vector
from protocols.kernels import inlined_kernel


@inlined_kernel
def pair_term(r: Vector, w: Vector, u: Vector, gains: Gains) -> Vector:
    """Acceleration [m/s²] because of one neighbour.

    ``r``: its position minus mine [m]; ``w``: its velocity minus mine [m/s]; ``u``: my heading (unit).
    """
    (r_x, r_y), (w_x, w_y), (u_x, u_y) = r, w, u
    d = math.sqrt(r_x * r_x + r_y * r_y)
    if d < 1e-6:
        return 0.0, 0.0
    n_x = -r_x / d
    n_y = -r_y / d
    a_x = 0.0
    a_y = 0.0

    if d < gains.morse_range:
        e = exp(-gains.morse_decay * (d - gains.morse_range))
        push = gains.morse_strength * (e * e - e)
        a_x += push * n_x
        a_y += push * n_y
        if r_x * u_x + r_y * u_y > 0.0:
            aside = gains.sidestep * (1.0 - d / gains.morse_range)
            a_x -= aside * n_y
            a_y += aside * n_x
    if d < gains.agent_barrier_range:
        push = gains.agent_barrier * (gains.agent_barrier_range - d) / max(d - gains.contact_m + 0.01, 0.01)
        a_x += push * n_x
        a_y += push * n_y

    opening = r_x * w_x + r_y * w_y
    if opening < 0.0:
        speed2 = w_x * w_x + w_y * w_y
        time = -opening / speed2
        miss_x = -(r_x + w_x * time)
        miss_y = -(r_y + w_y * time)
        miss = math.sqrt(miss_x * miss_x + miss_y * miss_y)
        conflict = 1.0 - miss / gains.predict_radius
        if conflict > 0.0:
            speed = math.sqrt(speed2)
            if miss > 1e-6:
                miss_x /= miss
                miss_y /= miss
            else:
                miss_x = -w_y / speed
                miss_y = w_x / speed
            push = gains.predict_gain * conflict * exp(-time / gains.predict_time) * speed
            closing = -opening / d
            brake = gains.agent_brake * conflict * closing * closing / (2.0 * max(d - gains.contact_m, 0.1))
            a_x += push * miss_x + brake * n_x
            a_y += push * miss_y + brake * n_y
    return a_x, a_y


@inlined_kernel
def agent_terms(near: Neighbours, u: Vector, gains: Gains) -> Vector:
    """Sum of ``pair_term`` over all neighbours [m/s²]; ``u``: my heading."""
    a_x = 0.0
    a_y = 0.0
    for j in range(near.size):
        b_x, b_y = pair_term(vector(near.rel, j), vector(near.vel, j), u, gains)
        a_x += b_x
        a_y += b_y
    return a_x, a_y
