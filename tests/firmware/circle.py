"""The circle on which vehicles with real firmware are led."""

import math

from agent.air.vehicle import Setpoint


def on_circle(x: float, y: float, now: float, height: float, radius: float, speed: float) -> Setpoint:
    """Where to be ``now`` [s] on a circle that began at ``x``, ``y`` [m] towards +y."""
    angle = speed * now / radius
    c, s = math.cos(angle), math.sin(angle)
    return Setpoint(
        (x + radius * (c - 1.0), y + radius * s, height),
        (-speed * s, speed * c, 0.0),
        (-c * speed**2 / radius, -s * speed**2 / radius, 0.0),
    )
