"""How a drone moves: the double integrator with its limits (paper, eq. "Unified dynamics constraints").

a   = Pi_a_max(a_command)          Pi_rho(x) = x min(1, rho / |x|)
v'  = Pi_v_max(v + a dt)
p'  = p + dt/2 (v + v')
"""

import math
from typing import Any

from numpy.typing import NDArray

from protocols.kernels import inlined_kernel, kernel

TICK_S = 0.01  #: one tick of every clock, for everyone
TICKS_PER_S = 100
Vector = tuple[float, float]  #: (x forward, y left)
ABSURD_MPS2 = 1e6  # a component of a command beyond this is an error, not a wish: nobody follows it


def ticks_of(seconds: float) -> int:
    """The whole number of ticks nearest to so many seconds."""
    return round(seconds / TICK_S)


@inlined_kernel
def vector(rows: NDArray[Any], row: int) -> Vector:
    """One row of an array (R, 2)."""
    return rows[row, 0], rows[row, 1]


@kernel
def clip_ball(x: float, y: float, radius: float) -> tuple[float, float]:
    """The vector (x, y) shortened to at most ``radius``."""
    length = math.sqrt(x * x + y * y)
    if length <= radius:
        return x, y
    return x * radius / length, y * radius / length


@inlined_kernel
def target_x(tick: int, target_mps: float) -> float:
    """Where the virtual target is at ``tick``: x [m] in the common frame; it starts at the origin and flies along x."""
    return target_mps * TICK_S * tick


@kernel
def integrate(
    position: Vector, velocity: Vector, command: Vector, a_max: float, v_max: float, dt: float
) -> tuple[Vector, Vector]:
    """Position [m] and velocity [m/s] after one step of ``dt`` seconds under the commanded acceleration [m/s^2]."""
    (px, py), (vx, vy) = position, velocity
    ax, ay = clip_ball(command[0], command[1], a_max)
    wx, wy = clip_ball(vx + ax * dt, vy + ay * dt, v_max)
    return (px + 0.5 * dt * (vx + wx), py + 0.5 * dt * (vy + wy)), (wx, wy)
