"""The compiled loop of the batch simulation: many ticks of many worlds without Python in between.

It calls the rules of the drones (agent) and of nature (world) one after the other, world by world, in the order of
`world.director`, whose flight it repeats bit for bit (tests/rsc_swarm/test_batch.py):

    policy -> follow or decide -> safety filter -> move -> judge -> reconfigure -> sense, perceive, observe

Slots are traded by one who sees all (`_reconfigure`). What drones see and hear of each other is in rsc_swarm.batch.looking.
"""

import numpy as np
from numpy.typing import NDArray

from agent.control.apf import expert as papers_expert
from agent.control.attraction import Aim
from agent.control.detour import leave_pocket
from agent.control.follow import Following, Plan, follow_row
from agent.control.safety import safety_filter
from agent.control.surroundings import Discs
from agent.memory import discs_of, neighbours_of
from agent.observation import aim_of
from agent.policy.analytic_kernel import analytic
from agent.tick_arrays import TickArrays
from protocols.dynamics import TICK_S, Vector, target_x, vector
from protocols.kernels import allocating_kernel, inlined_kernel, kernel
from protocols.mission.formation import NO_PARENT
from protocols.slots import trigger
from rsc_swarm.batch.looking import keep, look, observe
from rsc_swarm.batch.stage import (
    ANALYTIC,
    COLLIDED,
    EXPERT,
    FLYING,
    LATE,
    PAST,
    SUCCEEDED,
    Field,
    Scratch,
    Stage,
    bodies_of,
    ground_of,
)
from world import referee
from world.plant import move_world


@inlined_kernel
def _led(row: int, world: int, stage: Stage, arrays: TickArrays, aim: Aim) -> tuple[Aim, Vector]:
    """``aim`` with the leader where it truly is, and the leader's velocity [m/s]; the root's leader is the target."""
    shape, views = arrays.shape, arrays.views
    slot = views.slot_of[row, arrays.work.me[row]]
    above = shape.parent[slot]
    if above == NO_PARENT:
        return Aim(aim.slot_error, aim.slot_error, aim.velocity, aim.target_velocity), aim.target_velocity
    leader = views.occupant[row, above]
    (x, y), offsets = vector(arrays.sensed.position, row), shape.offsets
    place_x = stage.position[world, leader, 0] + offsets[slot, 0] - offsets[above, 0]
    place_y = stage.position[world, leader, 1] + offsets[slot, 1] - offsets[above, 1]
    velocity = (stage.velocity[world, leader, 0], stage.velocity[world, leader, 1])
    return Aim((place_x - x, place_y - y), aim.slot_error, aim.velocity, aim.target_velocity), velocity


@inlined_kernel
def _expert(
    world: int, agent: int, stage: Stage, field: Field, arrays: TickArrays, scratch: Scratch
) -> Vector:
    """The expert's command, with every obstacle of the field in view: the analytic controller without memory of sides, safe, or
    the paper's three terms alone."""
    row = world * stage.flying.shape[1] + agent
    (x, y), count = vector(arrays.sensed.position, row), stage.obstacle_count[world]
    for index in range(count):
        disc = stage.obstacles[world, index]
        scratch.rel[index, 0], scratch.rel[index, 1] = disc[0] - x, disc[1] - y
        scratch.radius[index], scratch.side[index] = disc[2], 0
    aim, near = aim_of(row, arrays.work, arrays.sensed), neighbours_of(arrays.memory, row)
    discs = Discs(count, scratch.rel, scratch.radius, scratch.side)
    if field.papers:
        led, leader_velocity = _led(row, world, stage, arrays, aim)
        return papers_expert(led, leader_velocity, near, discs, field.following.apf)
    aim = Aim(aim.slot_error, aim.slot_error, aim.velocity, aim.target_velocity)
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
def _reconfigure(world: int, stage: Stage, field: Field, arrays: TickArrays) -> None:
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
            if field.both_rest and tick < stage.rested[world, other]:
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
                    work.chain_error[row, 0], work.chain_error[row, 1], rx, ry, dx, dy, rules.margin_m
                )
            if gain > best_gain and (
                not rules.connected
                or trigger.affected_connected(
                    mine, theirs, shape.parent, arrays.views.occupant[row], memory.hops[row], memory.rel[row],
                    arrays.rules.radio.range_m,
                )
            ):  # fmt: skip
                best, partner, best_gain = agent, other, gain
    if best < 0:
        return
    mine, theirs = stage.claim[world, best], stage.claim[world, partner]
    stage.claim[world, best], stage.claim[world, partner] = theirs, mine
    for row in range(world * agents, (world + 1) * agents):
        arrays.views.slot_of[row, best], arrays.views.slot_of[row, partner] = theirs, mine
        arrays.views.occupant[row, theirs], arrays.views.occupant[row, mine] = best, partner
    stage.rested[world, best] = tick + field.cooldown_ticks
    if field.both_rest:
        stage.rested[world, partner] = tick + field.cooldown_ticks
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
    move_world(world, bodies_of(stage), field.a_max, field.v_max, TICK_S)
    stage.ticks[world] += 1


@inlined_kernel
def _judge(world: int, stage: Stage, field: Field, arrays: TickArrays, holder: NDArray[np.int64]) -> None:
    shape, x = arrays.shape, target_x(stage.ticks[world], arrays.rules.target_mps)
    standard = referee.Standard(
        shape.offsets, shape.parent, field.spacing_m, field.edge_tolerance, field.collision_m, True
    )
    referee.judge_world(
        world, bodies_of(stage), stage.claim, ground_of(stage), x, standard, stage.findings, holder
    )


@kernel
def begin(world: int, stage: Stage, field: Field, arrays: TickArrays) -> None:
    """The first look of an episode; the history repeats it."""
    look(world, stage, field, arrays, True)
    for past in range(PAST):
        observe(world, past, stage, arrays)


@kernel
def fly(ticks: int, stage: Stage, field: Field, arrays: TickArrays, scratch: Scratch) -> None:
    """Fly every world that is FLYING by ``ticks`` ticks, or to its end; plans were made now."""
    agents = stage.flying.shape[1]
    for world in range(stage.flying.shape[0]):
        if stage.result[world] != FLYING:
            continue
        kept = max(PAST - ticks, 0)
        for place in range(kept):
            keep(world, place, place + ticks, stage)
        for agent in range(agents):
            for axis in range(2):
                stage.start[world, agent, axis] = stage.position[world, agent, axis]
                stage.start[world, agent, 2 + axis] = stage.velocity[world, agent, axis]
        for age in range(ticks):
            for agent in range(agents):
                if stage.pilot[world] == EXPERT:
                    ax, ay = _expert(world, agent, stage, field, arrays, scratch)
                else:
                    ax, ay = _decentralized(world, agent, age, stage, field.following, arrays)
                stage.command[world, agent, 0], stage.command[world, agent, 1] = ax, ay
            _move(world, stage, field)
            _judge(world, stage, field, arrays, scratch.holder)
            if field.ends:
                _settle(world, stage, field)
                if stage.result[world] != FLYING:
                    break
            look(world, stage, field, arrays, True)
            if arrays.rules.swap.rule != trigger.OFF:
                _reconfigure(world, stage, field, arrays)
            left = ticks - 1 - age
            if left < PAST:
                observe(world, left, stage, arrays)


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
                ax, ay = _expert(world, agent, stage, field, arrays, scratch)
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
            look(world, stage, field, arrays, False)
        for agent in range(agents):
            for axis in range(2):
                stage.position[world, agent, axis], stage.velocity[world, agent, axis] = (
                    p[agent, axis],
                    v[agent, axis],
                )
        stage.ticks[world] = tick
        look(world, stage, field, arrays, False)
