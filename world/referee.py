"""The referee: what counts as collision and success, and how good the formation is.

    collision  two drones, or a drone and an obstacle's surface, closer than limits.collision_m at any tick
    success    the first tick at which every drone has passed the goal line (and every obstacle) and every edge of the slot
               tree has a length error below the tolerance; who is at which slot is what the drones themselves claim
    late       neither within the time limit

A drone that died is out of the air. A slot may be empty only if all slots below it in the tree are.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.arithmetic import length
from protocols.kernels import allocating_kernel, inlined_kernel
from protocols.mission.formation import NO_PARENT
from world.order import put_in_order
from world.plant import Bodies, Ground


class Verdict(NamedTuple):
    """What the referee says of one world after one tick.

    closest_agents_m: distance of the nearest two drones, agent_a and agent_b. closest_obstacle_m: least distance of a drone,
    agent_c, from the surface of an obstacle. edge_error: the worst relative error of an edge's length. slot_error_m: the farthest
    that a drone is from virtual target + slot offset. shared_slots: claims of slots that others claim, too. complete: all slots
    but empty leaves are held, by one each. passed: all are beyond the goal line. standing: the formation stands; formed: it does
    so beyond the goal line, which is success. collided: anybody did.
    """

    closest_agents_m: float = math.inf
    agent_a: int = -1
    agent_b: int = -1
    closest_obstacle_m: float = math.inf
    agent_c: int = -1
    obstacle: int = -1
    edge_error: float = 0.0
    slot_error_m: float = 0.0
    shared_slots: int = 0
    complete: bool = False
    passed: bool = False
    standing: bool = False
    formed: bool = False
    collided: bool = False


VERDICT = np.dtype(
    [*Verdict.__annotations__.items()], align=True
)  #: one Verdict as a record, for arrays of them


class Standard(NamedTuple):
    """What is judged by: offsets (N, 2) [m], parent (N,): the formation. spacing_m: the length of its edges,
    edge_tolerance: the relative error below which one stands. collision_m: nearer than this is a collision. closed: whether those
    below an empty slot must have moved up."""

    offsets: NDArray[np.float64]
    parent: NDArray[np.int16]
    spacing_m: float
    edge_tolerance: float
    collision_m: float
    closed: bool


class Findings(NamedTuple):
    """What is found.

    nearest: (E, N) distance to the nearest drone or obstacle surface [m]. edge_error: (E, N) relative length error of the edge to
    the leader's slot, 0 for the root's holder. verdict: (E,) of VERDICT.
    """

    nearest: NDArray[np.float64]
    edge_error: NDArray[np.float64]
    verdict: NDArray[np.void]


def empty_findings(worlds: int, agents: int) -> Findings:
    """Nothing found yet."""
    return Findings(
        np.full((worlds, agents), np.inf), np.zeros((worlds, agents)), np.array([Verdict()] * worlds, VERDICT)
    )


@inlined_kernel
def _nearest(world: int, place: int, bodies: Bodies) -> tuple[float, int]:
    """The square of the distance from the drone at this place in the order to the nearest other [m^2], and which that is: of
    several the one with the lowest number; infinity and -1 if there is none."""
    flying, position, by_x = bodies.flying, bodies.position, bodies.by_x
    agent = by_x[world, place]
    px, py = position[world, agent, 0], position[world, agent, 1]
    least, nearest = np.inf, -1
    for step in range(-1, 2, 2):
        at = place + step
        while 0 <= at < flying.shape[1]:
            other = by_x[world, at]
            dx, dy = position[world, other, 0] - px, position[world, other, 1] - py
            if dx * dx > least:
                break
            gap2 = dx * dx + dy * dy
            if flying[world, other] and (gap2 < least or (gap2 == least and other < nearest)):
                least, nearest = gap2, other
            at += step
    return least, nearest


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
    closest, first, second = np.inf, -1, -1
    clearance, who, which = np.inf, -1, -1
    worst_edge, worst_slot, shared = 0.0, 0.0, 0
    anyone, passed = False, True
    for agent in range(agents):
        nearest[world, agent], edge_error[world, agent], holder[agent] = np.inf, 0.0, -1
    put_in_order(bodies.by_x[world], position[world])
    for place in range(agents):
        agent = bodies.by_x[world, place]
        if not flying[world, agent]:
            continue
        gap2, other = _nearest(world, place, bodies)
        nearest[world, agent] = math.sqrt(gap2)
        a, b = min(agent, other), max(agent, other)
        if other >= 0 and (
            gap2 < closest or (gap2 == closest and (a < first or (a == first and b < second)))
        ):
            closest, first, second = gap2, a, b
    closest = math.sqrt(closest)
    for agent in range(agents):
        if not flying[world, agent]:
            continue
        anyone = True
        px, py = position[world, agent, 0], position[world, agent, 1]
        for index in range(obstacle_count[world]):
            disc = obstacles[world, index]
            gap = length(disc[0] - px, disc[1] - py) - disc[2]
            nearest[world, agent] = min(nearest[world, agent], gap)
            if gap < clearance:
                clearance, who, which = gap, agent, index
        passed &= px > ground.goal_x[world]
        slot = claim[world, agent]
        shared += holder[slot] >= 0
        holder[slot] = agent
        wide = length(target_x + offsets[slot, 0] - px, offsets[slot, 1] - py)
        worst_slot = max(worst_slot, wide)
    complete = shared == 0
    for slot in range(agents):
        follower = holder[slot]
        if follower < 0 or parent[slot] == NO_PARENT:
            continue
        leader = holder[parent[slot]]
        if leader < 0:
            complete &= not standard.closed
            continue
        dx = position[world, follower, 0] - position[world, leader, 0]
        dy = position[world, follower, 1] - position[world, leader, 1]
        error = abs(math.sqrt(dx * dx + dy * dy) - spacing) / spacing
        edge_error[world, follower] = error
        worst_edge = max(worst_edge, error)
    standing = anyone and complete and worst_edge < standard.edge_tolerance
    verdict = findings.verdict[world]
    verdict["closest_agents_m"], verdict["agent_a"], verdict["agent_b"] = closest, first, second
    verdict["closest_obstacle_m"], verdict["agent_c"], verdict["obstacle"] = clearance, who, which
    verdict["edge_error"], verdict["slot_error_m"], verdict["shared_slots"] = worst_edge, worst_slot, shared
    verdict["complete"], verdict["passed"] = complete, passed
    verdict["standing"], verdict["formed"] = standing, standing and passed
    verdict["collided"] = min(closest, clearance) < standard.collision_m


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
