"""The referee: what counts as collision and success, and how good the formation is.

    collision  two drones, or a drone and an obstacle's surface, closer than limits.collision_m at any tick
    success    the first tick at which every drone has passed the goal line (and every obstacle) and every edge of the slot
               tree has a length error below the tolerance; who is at which slot is what the drones themselves claim
    late       neither within the time limit

A drone that died is out of the air. Its slot may stay empty only if that slot is a leaf of the tree.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.kernels import allocating_kernel, inlined_kernel
from protocols.mission.formation import NO_PARENT
from world.plant import Bodies, Ground

# Columns of a verdict: one row of floats per world and tick.
(CLOSEST_AGENTS, AGENT_A, AGENT_B, CLOSEST_OBSTACLE, AGENT_C, OBSTACLE, EDGE_ERROR, EDGE_CHILD, SLOT_ERROR, COMPLETE, PASSED,
 SHARED_SLOTS, STANDING, FORMED, COLLIDED) = range(15)  # fmt: skip
VERDICT_SIZE = 15


class Standard(NamedTuple):
    """What is judged by: offsets (N, 2) [m], parent (N,), is_leaf (N,): the formation. spacing_m: the length of its edges,
    edge_tolerance: the relative error below which one stands. collision_m: nearer than this is a collision."""

    offsets: NDArray[np.float64]
    parent: NDArray[np.int16]
    is_leaf: NDArray[np.bool_]
    spacing_m: float
    edge_tolerance: float
    collision_m: float


class Findings(NamedTuple):
    """What is found.

    nearest: (E, N) distance to the nearest drone or obstacle surface [m]. edge_error: (E, N) relative length error of the edge to
    the leader's slot, 0 for the root's holder.
    verdict: (E, VERDICT_SIZE) closest pair of drones [m, who, who]; closest obstacle surface [m, who, which]; worst
        relative edge error and the agent at its follower end; worst distance from virtual target + slot offset [m];
        1 if all slots but empty leaves are held; 1 if all have passed the goal line; slots claimed more than once; 1 if
        the formation stands; 1 if it stands beyond the goal line, which is success; 1 if anything collided.
    """

    nearest: NDArray[np.float64]
    edge_error: NDArray[np.float64]
    verdict: NDArray[np.float64]


@inlined_kernel
def judge_world(
    world: int, bodies: Bodies, claim: NDArray[np.int16], ground: Ground, target_x: float, standard: Standard,
    findings: Findings, holder: NDArray[np.int64],
) -> None:  # fmt: skip
    """Measure one world after a tick; arguments as `judge`. ``holder`` (N,): scratch. ``target_x``: the virtual target [m]."""
    flying, position = bodies.flying, bodies.position
    obstacle_count, obstacles = ground.obstacle_count, ground.obstacles
    offsets, parent, spacing = standard.offsets, standard.parent, standard.spacing_m
    nearest, edge_error = findings.nearest, findings.edge_error
    agents = flying.shape[1]
    result = findings.verdict[world]
    result[CLOSEST_AGENTS], result[CLOSEST_OBSTACLE] = np.inf, np.inf
    result[EDGE_ERROR], result[EDGE_CHILD], result[SLOT_ERROR] = 0.0, -1, 0.0
    result[COMPLETE], result[PASSED], result[SHARED_SLOTS] = 1.0, 1.0, 0.0
    for agent in range(agents):
        nearest[world, agent], edge_error[world, agent], holder[agent] = np.inf, 0.0, -1
    for agent in range(agents):  # pairs, by squares of distances
        if not flying[world, agent]:
            continue
        px, py = position[world, agent, 0], position[world, agent, 1]
        nearest2 = nearest[world, agent]
        for other in range(agent + 1, agents):
            if flying[world, other]:
                dx, dy = position[world, other, 0] - px, position[world, other, 1] - py
                gap2 = dx * dx + dy * dy
                nearest[world, other] = min(nearest[world, other], gap2)
                if gap2 < nearest2:
                    nearest2 = gap2
                    if gap2 < result[CLOSEST_AGENTS]:
                        result[CLOSEST_AGENTS], result[AGENT_A], result[AGENT_B] = gap2, agent, other
        nearest[world, agent] = math.sqrt(nearest2)
    result[CLOSEST_AGENTS] = math.sqrt(result[CLOSEST_AGENTS])
    anyone = False
    for agent in range(agents):
        if not flying[world, agent]:
            continue
        anyone = True
        px, py = position[world, agent, 0], position[world, agent, 1]
        for index in range(obstacle_count[world]):
            disc = obstacles[world, index]
            gap = math.sqrt((disc[0] - px) ** 2 + (disc[1] - py) ** 2) - disc[2]
            nearest[world, agent] = min(nearest[world, agent], gap)
            if gap < result[CLOSEST_OBSTACLE]:
                result[CLOSEST_OBSTACLE], result[AGENT_C], result[OBSTACLE] = gap, agent, index
        if px <= ground.goal_x[world]:
            result[PASSED] = 0.0
        slot = claim[world, agent]
        if holder[slot] >= 0:
            result[SHARED_SLOTS] += 1.0
            result[COMPLETE] = 0.0
        holder[slot] = agent
        wide = math.sqrt((target_x + offsets[slot, 0] - px) ** 2 + (offsets[slot, 1] - py) ** 2)
        result[SLOT_ERROR] = max(result[SLOT_ERROR], wide)
    for slot in range(agents):
        follower = holder[slot]
        if follower < 0:
            if not standard.is_leaf[slot]:
                result[COMPLETE] = 0.0
            continue
        if parent[slot] == NO_PARENT or holder[parent[slot]] < 0:
            continue
        leader = holder[parent[slot]]
        dx = position[world, follower, 0] - position[world, leader, 0]
        dy = position[world, follower, 1] - position[world, leader, 1]
        error = abs(math.sqrt(dx * dx + dy * dy) - spacing) / spacing
        edge_error[world, follower] = error
        if error > result[EDGE_ERROR]:
            result[EDGE_ERROR], result[EDGE_CHILD] = error, follower
    stands = anyone and result[COMPLETE] > 0.0 and result[EDGE_ERROR] < standard.edge_tolerance
    result[STANDING] = 1.0 if stands else 0.0
    result[FORMED] = 1.0 if stands and result[PASSED] > 0.0 else 0.0
    result[COLLIDED] = (
        1.0 if min(result[CLOSEST_AGENTS], result[CLOSEST_OBSTACLE]) < standard.collision_m else 0.0
    )


@allocating_kernel
def judge(
    active: NDArray[np.bool_], bodies: Bodies, claim: NDArray[np.int16], ground: Ground, target: NDArray[np.float64],
    standard: Standard, findings: Findings,
) -> None:  # fmt: skip
    """Measure every active world (E,) after a tick, into ``findings``.

    Args:
        claim: (E, N) the slot each agent says it holds. target: (E,) x of the virtual target [m].
    """
    holder = np.empty(bodies.flying.shape[1], np.int64)
    for world in range(active.shape[0]):
        if active[world]:
            judge_world(world, bodies, claim, ground, target[world], standard, findings, holder)
