"""The compiled loop of the batch simulation: many ticks of many worlds without Python in between.

It calls the rules of the drones (agent) and of nature (world) one after the other, world by world, in the order of
`world.director`, whose flight it repeats bit for bit (tests/rsc_swarm/test_batch.py):

    policy -> follow or decide -> safety filter -> move -> judge -> reconfigure -> sense, perceive, observe

What is left out is what a perfect radio makes needless: frames. Neighbours are sensed, what they saw a tick ago is read
from their rows, and slots are traded by one who sees all (`_reconfigure`).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.control.detour import leave_pocket
from agent.control.follow import Following, Plan, follow_row
from agent.control.safety import safety_filter
from agent.control.surroundings import Discs
from agent.memory import discs_of, neighbours_of
from agent.observation import aim_of, aim_row, compressed, observe_row, observe_wide_row
from agent.perceive import find_sensed, recall_obstacles
from agent.policy.analytic_kernel import analytic
from agent.target import place_target
from agent.tick_arrays import TickArrays
from protocols.dynamics import TICK_S, Vector, target_x, vector
from protocols.kernels import allocating_kernel, inlined_kernel, kernel
from protocols.slots import trigger
from world import referee
from world.plant import Bodies, Ground, move_world, sense_world

PLAN, EXPERT, ANALYTIC = range(3)  # who flies the drones of a world
FLYING, SUCCEEDED, COLLIDED, LATE = range(4)
PAST = 4  # ticks of observations kept, the present one last


class Stage(NamedTuple):
    """E worlds of N drones; arrays as in world.core, and

    pilot: (E,) PLAN, EXPERT or ANALYTIC. ticks: (E,) flown. result: (E,). closest: (E,) smallest distance so far [m].
    formed: (E,) tick at which the formation first stood, -1 before. rested: (E, N) tick from which a drone may swap again.
    swaps: (E,). observation: (PAST, E, N, 18), near: (PAST, E, N, K): the last ticks. target: (E, N, 2), extra: (E, N, 32).
    """

    pilot: NDArray[np.int8]
    ticks: NDArray[np.int64]
    result: NDArray[np.int8]
    flying: NDArray[np.bool_]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    command: NDArray[np.float64]
    ability: NDArray[np.float64]
    claim: NDArray[np.int16]
    obstacle_count: NDArray[np.int64]
    obstacles: NDArray[np.float64]
    goal_x: NDArray[np.float64]
    findings: referee.Findings
    closest: NDArray[np.float64]
    formed: NDArray[np.int64]
    rested: NDArray[np.int64]
    swaps: NDArray[np.int64]
    observation: NDArray[np.float32]
    near: NDArray[np.int16]
    target: NDArray[np.float32]
    extra: NDArray[np.float32]
    start: NDArray[np.float64]
    displacement: NDArray[np.float32]
    acceleration: NDArray[np.float32]


class Field(NamedTuple):
    """The numbers of a mission that the loop needs. ends: an episode ends as a flight does; else when its flyer says so."""

    a_max: float
    v_max: float
    spacing_m: float
    edge_tolerance: float
    collision_m: float
    last_tick: int
    cooldown_ticks: int
    ends: bool
    following: Following


class Scratch(NamedTuple):
    """holder: (N,). rel (M, 2), radius (M,), side (M,): all obstacles as one drone sees them."""

    holder: NDArray[np.int64]
    rel: NDArray[np.float64]
    radius: NDArray[np.float64]
    side: NDArray[np.int8]


@inlined_kernel
def _bodies(stage: Stage) -> Bodies:
    return Bodies(stage.flying, stage.position, stage.velocity, stage.command, stage.ability)


@inlined_kernel
def _ground(stage: Stage) -> Ground:
    return Ground(stage.goal_x, stage.obstacle_count, stage.obstacles)


@inlined_kernel
def _look(world: int, stage: Stage, arrays: TickArrays, recall: bool) -> None:
    """Sense and perceive, for every drone of a world, where it is now."""
    rules, agents = arrays.rules, stage.flying.shape[1]
    sense_world(world, _bodies(stage), _ground(stage), rules.reach_m, True, arrays.sensed)
    for agent in range(agents):
        row = world * agents + agent
        find_sensed(arrays.memory, row, arrays.sensed)
        if recall:
            recall_obstacles(arrays.memory, row, arrays.sensed, rules.remember_obstacles)
        place_target(stage.ticks[world], row, rules.target_mps, arrays.work)
        aim_row(row, False, arrays.shape, arrays.views, arrays.work, arrays.sensed, arrays.memory)


@inlined_kernel
def _observe(world: int, past: int, stage: Stage, arrays: TickArrays) -> None:
    """Note what every drone of a world observes now, ``past`` ticks before the last entry of the history."""
    work, memory = arrays.work, arrays.memory
    place = PAST - 1 - past
    agents = stage.flying.shape[1]
    for agent in range(agents):
        row = world * agents + agent
        observe_row(
            row, arrays.rules.reach_m, work, arrays.sensed, memory, stage.observation[place, world, agent]
        )
        near = stage.near[place, world, agent]
        for index in range(near.shape[0]):
            near[index] = memory.near_id[row, index] if index < memory.near_count[row] else -1
        if past == 0:
            ex, ey = compressed(work.slot_error[row, 0], work.slot_error[row, 1])
            stage.target[world, agent, 0], stage.target[world, agent, 1] = ex, ey
            observe_wide_row(row, arrays.rules.reach_m, memory, stage.extra[world, agent])


@inlined_kernel
def _expert(world: int, agent: int, stage: Stage, arrays: TickArrays, scratch: Scratch) -> Vector:
    """The expert's command, safe: the analytic controller with every obstacle of the field in view and no memory of sides."""
    row = world * stage.flying.shape[1] + agent
    (x, y), count = vector(arrays.sensed.position, row), stage.obstacle_count[world]
    for index in range(count):
        disc = stage.obstacles[world, index]
        scratch.rel[index, 0], scratch.rel[index, 1] = disc[0] - x, disc[1] - y
        scratch.radius[index], scratch.side[index] = disc[2], 0
    aim, near = aim_of(row, arrays.work, arrays.sensed), neighbours_of(arrays.memory, row)
    discs = Discs(count, scratch.rel, scratch.radius, scratch.side)
    wanted = analytic(aim, near, discs, arrays.rules.gains)
    return safety_filter(wanted, aim.velocity, near, discs, arrays.rules.limits)


@inlined_kernel
def _decentralized(
    world: int, agent: int, age: int, stage: Stage, following: Following, arrays: TickArrays
) -> Vector:
    """A drone's command, safe: its plan of ``age`` ticks ago followed, or the analytic controller."""
    rules, row = arrays.rules, world * stage.flying.shape[1] + agent
    aim, near, discs = (
        aim_of(row, arrays.work, arrays.sensed),
        neighbours_of(arrays.memory, row),
        discs_of(arrays.memory, row),
    )
    if stage.pilot[world] == ANALYTIC:
        wanted = analytic(aim, near, discs, rules.gains)
    else:
        plan = Plan(
            stage.start[world, agent], stage.displacement[world, agent], stage.acceleration[world, agent]
        )
        position = vector(arrays.sensed.position, row)
        wanted = follow_row(age, plan, position, aim, near, discs, following)
    if rules.detour:
        wanted = leave_pocket(wanted, row, rules, arrays.work, arrays.sensed, arrays.memory)
    if rules.filtered:
        wanted = safety_filter(wanted, aim.velocity, near, discs, rules.limits)
    return wanted


@inlined_kernel
def _reconfigure(world: int, stage: Stage, cooldown_ticks: int, arrays: TickArrays) -> None:
    """The one swap of this tick that gains most, among drones within range that have rested; at once and known to all."""
    rules, shape, work, memory = arrays.rules.swap, arrays.shape, arrays.work, arrays.memory
    agents = stage.flying.shape[1]
    tick = stage.ticks[world]
    best, partner, best_gain = -1, -1, 0.0
    for agent in range(agents):
        if tick < stage.rested[world, agent]:
            continue
        row = world * agents + agent
        mine = stage.claim[world, agent]
        for index in range(memory.near_count[row]):
            other = memory.near_id[row, index]
            if tick < stage.rested[world, other]:
                continue
            theirs = stage.claim[world, other]
            dx = shape.offsets[theirs, 0] - shape.offsets[mine, 0]
            dy = shape.offsets[theirs, 1] - shape.offsets[mine, 1]
            rx, ry = memory.near_rel[row, index, 0], memory.near_rel[row, index, 1]
            gain = 0.0
            if rules.rule == trigger.CONTACT:
                if agent < other:
                    gain = trigger.contact_gain(rx, ry, dx, dy, rules.margin_m)
            elif shape.parent[theirs] == mine:
                gain = trigger.tree_gain(
                    work.slot_error[row, 0], work.slot_error[row, 1], rx, ry, dx, dy, rules.margin_m
                )
            if gain > best_gain:
                best, partner, best_gain = agent, other, gain
    if best < 0:
        return
    mine, theirs = stage.claim[world, best], stage.claim[world, partner]
    stage.claim[world, best], stage.claim[world, partner] = theirs, mine
    for row in range(world * agents, (world + 1) * agents):
        arrays.views.slot_of[row, best], arrays.views.slot_of[row, partner] = theirs, mine
    stage.rested[world, best] = stage.rested[world, partner] = tick + cooldown_ticks
    stage.swaps[world] += 1


@inlined_kernel
def _settle(world: int, stage: Stage, field: Field) -> None:
    """What the referee's verdict on this tick means for the flight."""
    verdict = stage.findings.verdict[world]
    nearest = min(verdict["closest_agents_m"], verdict["closest_obstacle_m"])
    stage.closest[world] = min(stage.closest[world], nearest)
    if stage.formed[world] < 0 and verdict["standing"]:
        stage.formed[world] = stage.ticks[world]
    if verdict["collided"]:
        stage.result[world] = COLLIDED
    elif verdict["formed"]:
        stage.result[world] = SUCCEEDED
    elif stage.ticks[world] >= field.last_tick:
        stage.result[world] = LATE


@inlined_kernel
def _move(world: int, stage: Stage, field: Field) -> None:
    move_world(world, _bodies(stage), field.a_max, field.v_max, TICK_S)
    stage.ticks[world] += 1


@inlined_kernel
def _judge(world: int, stage: Stage, field: Field, arrays: TickArrays, holder: NDArray[np.int64]) -> None:
    shape, x = arrays.shape, target_x(stage.ticks[world], arrays.rules.target_mps)
    standard = referee.Standard(
        shape.offsets, shape.parent, field.spacing_m, field.edge_tolerance, field.collision_m, True
    )
    referee.judge_world(
        world, _bodies(stage), stage.claim, _ground(stage), x, standard, stage.findings, holder
    )


@inlined_kernel
def _keep(world: int, place: int, source: int, stage: Stage) -> None:
    """What was seen at one place of the history is now at another; loops, because slices take long to compile."""
    for agent in range(stage.flying.shape[1]):
        for index in range(stage.observation.shape[3]):
            stage.observation[place, world, agent, index] = stage.observation[source, world, agent, index]
        for index in range(stage.near.shape[3]):
            stage.near[place, world, agent, index] = stage.near[source, world, agent, index]


@kernel
def begin(world: int, stage: Stage, field: Field, arrays: TickArrays) -> None:
    """The first look of an episode; the history repeats it."""
    _look(world, stage, arrays, True)
    for past in range(PAST):
        _observe(world, past, stage, arrays)


@kernel
def fly(ticks: int, stage: Stage, field: Field, arrays: TickArrays, scratch: Scratch) -> None:
    """Fly every world that is FLYING by ``ticks`` ticks, or to its end; plans were made now."""
    agents = stage.flying.shape[1]
    for world in range(stage.flying.shape[0]):
        if stage.result[world] != FLYING:
            continue
        kept = max(PAST - ticks, 0)
        for place in range(kept):
            _keep(world, place, place + ticks, stage)
        for agent in range(agents):
            for axis in range(2):
                stage.start[world, agent, axis] = stage.position[world, agent, axis]
                stage.start[world, agent, 2 + axis] = stage.velocity[world, agent, axis]
        for age in range(ticks):
            for agent in range(agents):
                if stage.pilot[world] == EXPERT:
                    ax, ay = _expert(world, agent, stage, arrays, scratch)
                else:
                    ax, ay = _decentralized(world, agent, age, stage, field.following, arrays)
                stage.command[world, agent, 0], stage.command[world, agent, 1] = ax, ay
            _move(world, stage, field)
            _judge(world, stage, field, arrays, scratch.holder)
            if field.ends:
                _settle(world, stage, field)
                if stage.result[world] != FLYING:
                    break
            _look(world, stage, arrays, True)
            if arrays.rules.swap.rule != trigger.OFF:
                _reconfigure(world, stage, field.cooldown_ticks, arrays)
            left = ticks - 1 - age
            if left < PAST:
                _observe(world, left, stage, arrays)


@allocating_kernel
def label(
    stage: Stage, field: Field, arrays: TickArrays, scratch: Scratch, displacement: NDArray[np.float32],
    velocity_change: NDArray[np.float32],
) -> None:  # fmt: skip
    """What the expert would do from here, flying all drones of every world that is FLYING; everything is put back after.

    Args:
        displacement, velocity_change: (E, N, H, 2) out: p(t + h + 1) - p(t) - (h + 1) dt v(t) [m] and v(t + h + 1) - v(t) [m/s].
    """
    worlds, agents = stage.flying.shape
    horizon = displacement.shape[2]
    p, v = np.empty((agents, 2)), np.empty((agents, 2))
    for world in range(worlds):
        if stage.result[world] != FLYING:
            continue
        tick = stage.ticks[world]
        for agent in range(agents):
            for axis in range(2):
                p[agent, axis], v[agent, axis] = (
                    stage.position[world, agent, axis],
                    stage.velocity[world, agent, axis],
                )
        for step in range(horizon):
            for agent in range(agents):
                ax, ay = _expert(world, agent, stage, arrays, scratch)
                stage.command[world, agent, 0], stage.command[world, agent, 1] = ax, ay
            _move(world, stage, field)
            ahead = (step + 1) * TICK_S
            for agent in range(agents):
                for axis in range(2):
                    flown = stage.position[world, agent, axis] - p[agent, axis] - ahead * v[agent, axis]
                    displacement[world, agent, step, axis] = flown
                    velocity_change[world, agent, step, axis] = (
                        stage.velocity[world, agent, axis] - v[agent, axis]
                    )
            _look(world, stage, arrays, False)
        for agent in range(agents):
            for axis in range(2):
                stage.position[world, agent, axis], stage.velocity[world, agent, axis] = (
                    p[agent, axis],
                    v[agent, axis],
                )
        stage.ticks[world] = tick
        _look(world, stage, arrays, False)
