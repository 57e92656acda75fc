"""The analytic decentralized controller for one agent: the sum of attraction, obstacle and agent terms."""

import numpy as np
from numpy.typing import NDArray

from agent.control.agents import agent_terms
from agent.control.attraction import attraction, heading
from agent.control.gains import Gains
from agent.control.obstacles import obstacle_terms
from protocols.kernels import inlined_kernel


@inlined_kernel
def analytic(
    e_c: NDArray[np.float64],
    e_g: NDArray[np.float64],
    v: NDArray[np.float64],
    v_target: NDArray[np.float64],
    k: int,
    rel: NDArray[np.float64],
    vel: NDArray[np.float64],
    m: int,
    o_rel: NDArray[np.float64],
    o_radius: NDArray[np.float64],
    o_side: NDArray[np.int8],
    gains: Gains,
) -> tuple[float, float]:
    """Desired acceleration [m/s²] of one agent, not yet limited: the safety filter comes after.

    All vectors are in one common frame, x forward and y left. ``e_c``, ``e_g`` (2,): chain and slot target
    minus own position [m]; ``v``, ``v_target`` (2,) [m/s]; ``rel`` [m], ``vel`` [m/s] (K, 2): neighbours
    minus me, the first ``k`` rows count; ``o_rel`` (M, 2): obstacle centres minus me [m], ``o_radius`` (M,)
    [m], ``o_side`` (M,) int8: which side each obstacle is passed on (0 undecided, +1 left, -1 right),
    updated in place; the first ``m`` rows count.
    """
    u_x, u_y = heading(e_c[0], e_c[1], e_g[0], e_g[1], v_target[0], v_target[1], gains)
    pull_x, pull_y = attraction(e_c[0], e_c[1], e_g[0], e_g[1], v[0], v[1], v_target[0], v_target[1], gains)
    avoid_x, avoid_y = obstacle_terms(m, o_rel, o_radius, o_side, v[0], v[1], u_x, u_y, pull_x, pull_y, gains)
    apart_x, apart_y = agent_terms(k, rel, vel, u_x, u_y, gains)
    return pull_x + avoid_x + apart_x, pull_y + avoid_y + apart_y
