"""The analytic decentralized controller for one agent: the sum of attraction, obstacle and agent terms."""

from agent.control.agents import agent_terms
from agent.control.attraction import Aim, attraction, heading
from agent.control.gains import Gains
from agent.control.obstacles import obstacle_terms
from agent.control.surroundings import Discs, Neighbours
from protocols.dynamics import Vector
from protocols.kernels import inlined_kernel


@inlined_kernel
def analytic(aim: Aim, near: Neighbours, discs: Discs, gains: Gains) -> Vector:
    """Desired acceleration [m/s²] of one agent, not yet limited: the safety filter comes after.

    All vectors are in one common frame, x forward and y left. ``discs.side`` is updated.
    """
    u = heading(aim, gains)
    pull = attraction(aim, gains)
    avoid_x, avoid_y = obstacle_terms(discs, aim.velocity, u, pull, gains)
    apart_x, apart_y = agent_terms(near, u, gains)
    return pull[0] + avoid_x + apart_x, pull[1] + avoid_y + apart_y
