"""Following a predicted trajectory: the paper's inverse dynamics, and a smooth alternative.

The paper asks for the acceleration that reaches the next point within one step. It is exact for a smooth
trajectory but marginally stable: v+ = 2 dp/dt - v has the eigenvalue -1, so 1 mm of white noise on the
points saturates the command. The smooth form follows the trajectory's own acceleration and damps what is
left, critically by default.
"""

from protocols.kernels import kernel


@kernel
def required_acceleration(r_x: float, r_y: float, v_x: float, v_y: float, dt: float) -> tuple[float, float]:
    """The paper's a_req = 2/dt² (p_req - p - v dt) [m/s²]; ``r`` = p_req - p [m], ``v`` [m/s], ``dt`` [s]."""
    scale = 2.0 / (dt * dt)
    return scale * (r_x - v_x * dt), scale * (r_y - v_y * dt)


@kernel
def smooth_acceleration(
    e_x: float,
    e_y: float,
    w_x: float,
    w_y: float,
    forward_x: float,
    forward_y: float,
    kp: float = 25.0,
    kd: float = 10.0,
) -> tuple[float, float]:
    """Feed-forward plus PD [m/s²]: ``e`` = p_ref - p [m], ``w`` = v_ref - v [m/s], ``forward`` = a_ref.

    ``kp`` [1/s²], ``kd`` [1/s]: the defaults are critically damped with a time constant of 0.2 s.
    """
    return forward_x + kp * e_x + kd * w_x, forward_y + kp * e_y + kd * w_y
