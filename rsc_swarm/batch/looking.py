"""What the drones of the batch simulation see and hear, and what is noted of that for a policy.

Frames are left out where a perfect radio makes them needless: neighbours are sensed, and what they saw a tick ago is read from
their rows. Only where drones must know who is out of sight, to aim by the leader or to swap where all stay connected, do they
write frames and hear them (`_hear`).
"""

from agent.observation import aim_row, compressed, observe_row, observe_wide_row
from agent.perceive import compose_row, find_sensed, perceive_row, recall_obstacles
from agent.target import place_target
from agent.tick_arrays import TickArrays
from protocols.kernels import inlined_kernel
from protocols.wire.sensed import MAX_NEAR
from rsc_swarm.batch.stage import PAST, Field, Stage, bodies_of, ground_of
from world.plant import sense_world


@inlined_kernel
def _frame(tick: int, row: int, rows: int) -> int:
    """Where row ``row`` writes its frame of this tick: there is room for those of two ticks."""
    return tick % 2 * rows + row


@inlined_kernel
def _hear(tick: int, world: int, agents: int, stage: Stage, arrays: TickArrays) -> None:
    """Let every drone of a world hear the frames of those who were in range a tick ago, and know what it then knows."""
    work, memory, rows = arrays.work, arrays.memory, stage.flying.size
    for row in range(world * agents, (world + 1) * agents):
        place = row * MAX_NEAR
        work.inbox_start[row] = place
        if tick > 0:
            for index in range(memory.near_count[row]):
                sender = world * agents + memory.near_id[row, index]
                work.inbox[place] = _frame(tick - 1, sender, rows)
                place += 1
        # Whoever reads row after row needs no more than where this one ends.
        work.inbox_start[row + 1] = place
        perceive_row(tick, row, arrays.rules, work, arrays.sensed, arrays.frames, memory)


@inlined_kernel
def look(world: int, stage: Stage, field: Field, arrays: TickArrays, flown: bool) -> None:
    """Sense and perceive, for every drone of a world, where it is now; ``flown``: it is there, and not only thought to be."""
    rules, agents, tick = arrays.rules, stage.flying.shape[1], stage.ticks[world]
    sense_world(world, bodies_of(stage), ground_of(stage), rules.reach_m, True, arrays.sensed)
    if field.hears and flown:
        _hear(tick, world, agents, stage, arrays)
    for agent in range(agents):
        row = world * agents + agent
        if not (field.hears and flown):
            find_sensed(arrays.memory, row, arrays.sensed)
            if flown:
                recall_obstacles(arrays.memory, row, arrays.sensed, rules.remember_obstacles)
        place_target(tick, row, rules.target_mps, arrays.work)
        aim_row(row, rules.chain, arrays.shape, arrays.views, arrays.work, arrays.sensed, arrays.memory)
        if field.hears and flown:
            compose_row(
                tick, row, _frame(tick, row, stage.flying.size), rules, arrays.work, arrays.sensed, arrays.frames,
                arrays.memory,
            )  # fmt: skip


@inlined_kernel
def observe(world: int, past: int, stage: Stage, arrays: TickArrays) -> None:
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
            ex, ey = compressed(work.chain_error[row, 0], work.chain_error[row, 1])
            stage.target[world, agent, 0], stage.target[world, agent, 1] = ex, ey
            observe_wide_row(row, arrays.rules.reach_m, memory, stage.extra[world, agent])


@inlined_kernel
def keep(world: int, place: int, source: int, stage: Stage) -> None:
    """What was seen at one place of the history is now at another; loops, because slices take long to compile."""
    for agent in range(stage.flying.shape[1]):
        for index in range(stage.observation.shape[3]):
            stage.observation[place, world, agent, index] = stage.observation[source, world, agent, index]
        for index in range(stage.near.shape[3]):
            stage.near[place, world, agent, index] = stage.near[source, world, agent, index]
