"""The compiled loop of the batch simulation: many ticks of many worlds without Python in between.

It calls the rules of the drones (agent) and of nature (world) one after the other, world by world:

    policy -> follow or decide -> safety filter -> move -> judge -> reconfigure -> sense, perceive, observe

What is left out is what a perfect radio makes needless: frames. Neighbours are sensed, what they saw a tick ago is read
from their rows, and slots are traded by one who sees all (`_reconfigure`).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.control.detour import leave_pocket
from agent.control.follow import Following, follow_row
from agent.control.safety import safety_filter
from agent.memory import Memory
from agent.observation import aim_row, compressed, observe_row, observe_wide_row
from agent.perceive import find_neighbours, recall_obstacles
from agent.policy.analytic_kernel import analytic
from agent.target import place_target
from agent.tick_arrays import Rules, Shape, TickArrays, Views, Work
from protocols.dynamics import TICK_S, target_x
from protocols.kernels import borrowed, inlined_kernel, kernel
from protocols.slots import trigger
from protocols.wire.sensed import Sensed
from world import referee
from world.plant import move_world, sense_world

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
    is_leaf: NDArray[np.bool_]
    nearest: NDArray[np.float64]
    edge_error: NDArray[np.float64]
    verdict: NDArray[np.float64]
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
    """The numbers of a mission that the loop needs."""

    a_max: float
    v_max: float
    spacing_m: float
    edge_tolerance: float
    collision_m: float
    last_tick: int
    cooldown_ticks: int
    following: Following


class Scratch(NamedTuple):
    """holder: (N,). rel (M, 2), radius (M,), side (M,): all obstacles as one drone sees them."""

    holder: NDArray[np.int64]
    rel: NDArray[np.float64]
    radius: NDArray[np.float64]
    side: NDArray[np.int8]


@inlined_kernel
def _look(
    world: int, stage: Stage, field: Field, rules: Rules, shape: Shape, views: Views, work: Work, sensed: Sensed,
    memory: Memory, recall: bool,
) -> None:  # fmt: skip
    """Sense and perceive, for every drone of a world, where it is now."""
    agents = stage.flying.shape[1]
    sense_world(
        world, stage.flying, stage.position, stage.velocity, stage.obstacle_count, stage.obstacles, rules.reach_m, True, sensed
    )  # fmt: skip
    for agent in range(agents):
        row = world * agents + agent
        find_neighbours(memory, row, agent, 0, sensed, True, 0, rules.range_m)
        if recall:
            recall_obstacles(memory, row, sensed, rules.remember_obstacles)
        place_target(stage.ticks[world], row, rules.target_mps, work)
        aim_row(row, False, shape, views, work, sensed, memory)


@inlined_kernel
def _observe(
    world: int, past: int, stage: Stage, rules: Rules, work: Work, sensed: Sensed, memory: Memory
) -> None:
    """Note what every drone of a world observes now, ``past`` ticks before the last entry of the history."""
    place = PAST - 1 - past
    agents = stage.flying.shape[1]
    for agent in range(agents):
        row = world * agents + agent
        observe_row(row, rules.reach_m, work, sensed, memory, stage.observation[place, world, agent])
        near = stage.near[place, world, agent]
        near[:] = -1
        for index in range(min(memory.near_count[row], near.shape[0])):
            near[index] = memory.near_id[row, index]
        if past == 0:
            ex, ey = compressed(work.slot_error[row, 0], work.slot_error[row, 1])
            stage.target[world, agent, 0], stage.target[world, agent, 1] = ex, ey
            observe_wide_row(row, rules.reach_m, memory, stage.extra[world, agent])


@inlined_kernel
def _expert(
    world: int,
    agent: int,
    stage: Stage,
    rules: Rules,
    work: Work,
    sensed: Sensed,
    memory: Memory,
    scratch: Scratch,
) -> tuple[float, float]:
    """The expert's command, safe: the analytic controller with every obstacle of the field in view and no memory of sides."""
    row = world * stage.flying.shape[1] + agent
    motion, count = sensed.motion[row], stage.obstacle_count[world]
    for index in range(count):
        disc = stage.obstacles[world, index]
        scratch.rel[index, 0], scratch.rel[index, 1] = disc[0] - motion[0], disc[1] - motion[1]
        scratch.radius[index], scratch.side[index] = disc[2], 0
    ax, ay = analytic(
        work.slot_error[row], work.slot_error[row], motion[2:4], work.target_velocity[row], memory.near_count[row],
        memory.near_rel[row], memory.near_vel[row], count, scratch.rel, scratch.radius, scratch.side, rules.gains,
    )  # fmt: skip
    return safety_filter(
        ax, ay, motion[2], motion[3], memory.near_count[row], memory.near_rel[row], memory.near_vel[row], count, scratch.rel,
        scratch.radius, rules.limits,
    )  # fmt: skip


@inlined_kernel
def _decentralized(
    world: int,
    agent: int,
    age: int,
    stage: Stage,
    field: Field,
    rules: Rules,
    work: Work,
    sensed: Sensed,
    memory: Memory,
) -> tuple[float, float]:
    """A drone's command, safe: its plan of ``age`` ticks ago followed, or the analytic controller."""
    row = world * stage.flying.shape[1] + agent
    motion = sensed.motion[row]
    near_rel, near_vel = memory.near_rel[row], memory.near_vel[row]
    obstacle_rel, radius, side = memory.obstacle_rel[row], memory.obstacle_radius[row], memory.disc_side[row]
    if stage.pilot[world] == ANALYTIC:
        ax, ay = analytic(
            work.slot_error[row], work.slot_error[row], motion[2:4], work.target_velocity[row], memory.near_count[row],
            near_rel, near_vel, memory.disc_count[row], obstacle_rel, radius, side, rules.gains,
        )  # fmt: skip
    else:
        ax, ay = follow_row(
            age, stage.start[world, agent], stage.displacement[world, agent], stage.acceleration[world, agent], motion[0:2],
            motion[2:4], work.slot_error[row], work.target_velocity[row], memory.near_count[row], near_rel, near_vel,
            memory.disc_count[row], obstacle_rel, radius, side, field.following,
        )  # fmt: skip
    if rules.detour:
        ax, ay = leave_pocket(ax, ay, row, rules, work, sensed, memory)
    if rules.filtered:
        ax, ay = safety_filter(
            ax, ay, motion[2], motion[3], memory.near_count[row], near_rel, near_vel, memory.disc_count[row], obstacle_rel,
            radius, rules.limits,
        )  # fmt: skip
    return ax, ay


@inlined_kernel
def _reconfigure(
    world: int,
    stage: Stage,
    field: Field,
    rules: Rules,
    shape: Shape,
    views: Views,
    work: Work,
    memory: Memory,
) -> None:
    """The one swap of this tick that gains most, among drones within range that have rested; at once and known to all."""
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
            if rules.swap_rule == trigger.CONTACT:
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
        views.slot_of[row, best], views.slot_of[row, partner] = theirs, mine
    stage.rested[world, best] = stage.rested[world, partner] = tick + field.cooldown_ticks
    stage.swaps[world] += 1


@inlined_kernel
def _settle(world: int, stage: Stage, field: Field) -> None:
    """What the referee's verdict on this tick means for the flight."""
    verdict = stage.verdict[world]
    nearest = min(verdict[referee.CLOSEST_AGENTS], verdict[referee.CLOSEST_OBSTACLE])
    stage.closest[world] = min(stage.closest[world], nearest)
    if stage.formed[world] < 0 and verdict[referee.STANDING] > 0.0:
        stage.formed[world] = stage.ticks[world]
    if verdict[referee.COLLIDED] > 0.0:
        stage.result[world] = COLLIDED
    elif verdict[referee.FORMED] > 0.0:
        stage.result[world] = SUCCEEDED
    elif stage.ticks[world] >= field.last_tick:
        stage.result[world] = LATE


@inlined_kernel
def _move(world: int, stage: Stage, field: Field) -> None:
    move_world(
        world,
        stage.flying,
        stage.position,
        stage.velocity,
        stage.command,
        stage.ability,
        field.a_max,
        field.v_max,
        TICK_S,
    )
    stage.ticks[world] += 1


@kernel
def begin(world: int, stage: Stage, field: Field, arrays: TickArrays) -> None:
    """The first look of an episode; the history repeats it."""
    stage = borrowed(stage)
    rules, shape, views = arrays.rules, borrowed(arrays.shape), borrowed(arrays.views)
    work, sensed, memory = borrowed(arrays.work), borrowed(arrays.sensed), borrowed(arrays.memory)
    _look(world, stage, field, rules, shape, views, work, sensed, memory, True)
    for past in range(PAST):
        _observe(world, past, stage, rules, work, sensed, memory)


@kernel
def fly(ticks: int, stage: Stage, field: Field, arrays: TickArrays, scratch: Scratch) -> None:
    """Fly every world that is FLYING by ``ticks`` ticks, or to its end; plans were made now."""
    stage, scratch = borrowed(stage), borrowed(scratch)
    rules, shape, views = arrays.rules, borrowed(arrays.shape), borrowed(arrays.views)
    work, sensed, memory = borrowed(arrays.work), borrowed(arrays.sensed), borrowed(arrays.memory)
    agents = stage.flying.shape[1]
    for world in range(stage.flying.shape[0]):
        if stage.result[world] != FLYING:
            continue
        kept = max(PAST - ticks, 0)
        for place in range(kept):
            stage.observation[place, world] = stage.observation[place + ticks, world]
            stage.near[place, world] = stage.near[place + ticks, world]
        for agent in range(agents):
            for axis in range(2):
                stage.start[world, agent, axis] = stage.position[world, agent, axis]
                stage.start[world, agent, 2 + axis] = stage.velocity[world, agent, axis]
        for age in range(ticks):
            for agent in range(agents):
                if stage.pilot[world] == EXPERT:
                    ax, ay = _expert(world, agent, stage, rules, work, sensed, memory, scratch)
                else:
                    ax, ay = _decentralized(world, agent, age, stage, field, rules, work, sensed, memory)
                stage.command[world, agent, 0], stage.command[world, agent, 1] = ax, ay
            _move(world, stage, field)
            referee.judge_world(
                world, stage.flying, stage.position, stage.claim, target_x(stage.ticks[world], rules.target_mps),
                stage.goal_x, stage.obstacle_count, stage.obstacles, shape.offsets, shape.parent, stage.is_leaf,
                field.spacing_m, field.edge_tolerance, field.collision_m, scratch.holder, stage.nearest, stage.edge_error,
                stage.verdict,
            )  # fmt: skip
            _settle(world, stage, field)
            if stage.result[world] != FLYING:
                break
            _look(world, stage, field, rules, shape, views, work, sensed, memory, True)
            if rules.swap_rule != trigger.OFF:
                _reconfigure(world, stage, field, rules, shape, views, work, memory)
            left = ticks - 1 - age
            if left < PAST:
                _observe(world, left, stage, rules, work, sensed, memory)


@kernel
def label(
    stage: Stage, field: Field, arrays: TickArrays, scratch: Scratch, displacement: NDArray[np.float32],
    velocity_change: NDArray[np.float32],
) -> None:  # fmt: skip
    """What the expert would do from here, flying all drones of every world that is FLYING; everything is put back after.

    Args:
        displacement, velocity_change: (E, N, H, 2) out: p(t + h + 1) - p(t) - (h + 1) dt v(t) [m] and v(t + h + 1) - v(t) [m/s].
    """
    stage, scratch = borrowed(stage), borrowed(scratch)
    rules, shape, views = arrays.rules, borrowed(arrays.shape), borrowed(arrays.views)
    work, sensed, memory = borrowed(arrays.work), borrowed(arrays.sensed), borrowed(arrays.memory)
    worlds, agents = stage.flying.shape
    horizon = displacement.shape[2]
    p, v = np.empty((agents, 2)), np.empty((agents, 2))
    for world in range(worlds):
        if stage.result[world] != FLYING:
            continue
        tick = stage.ticks[world]
        p[:], v[:] = stage.position[world], stage.velocity[world]
        for step in range(horizon):
            for agent in range(agents):
                ax, ay = _expert(world, agent, stage, rules, work, sensed, memory, scratch)
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
            _look(world, stage, field, rules, shape, views, work, sensed, memory, False)
        stage.position[world], stage.velocity[world] = p, v
        stage.ticks[world] = tick
        _look(world, stage, field, rules, shape, views, work, sensed, memory, False)
