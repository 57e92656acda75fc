"""The two compiled halves of a drone's tick: all that comes before the policy, and all that comes after it.

Between them stand the slot protocol (only when there is news) and the policy, which are Python.
"""

import numpy as np
from numpy.typing import NDArray

from agent.control.detour import leave_pocket
from agent.control.safety import safety_filter
from agent.memory import Memory
from agent.observation import aim_row, observe_row
from agent.perceive import compose_row, perceive_row
from agent.target import place_target
from agent.tick_arrays import Rules, Shape, TickArrays, Views, Work
from protocols.dynamics import ABSURD_MPS2
from protocols.kernels import borrowed, inlined_kernel, kernel
from protocols.slots import trigger
from protocols.wire.sensed import Sensed


@inlined_kernel
def _aim_and_observe(
    row: int, rules: Rules, shape: Shape, views: Views, work: Work, sensed: Sensed, memory: Memory
) -> None:
    aim_row(row, rules.chain, shape, views, work, sensed, memory)
    observe_row(row, rules.reach_m, work, sensed, memory, work.observation[row])


@inlined_kernel
def _ask_triggers(
    tick: int, row: int, rules: Rules, shape: Shape, views: Views, work: Work, memory: Memory
) -> None:
    me, ex, ey = work.me[row], work.chain_error[row, 0], work.chain_error[row, 1]
    work.partner[row] = trigger.swap_partner(
        me, tick, rules.swap_rule, rules.margin_m, rules.connected, rules.memory_ticks, rules.range_m, ex, ey, shape.offsets,
        shape.parent, shape.depth, views.slot_of[row], views.occupant[row], memory.heard_tick[row], memory.hops[row],
        memory.rel[row],
    )  # fmt: skip
    work.vacated[row] = trigger.vacancy_to_fill(
        me, tick, rules.silent_ticks, rules.range_m, ex, ey, shape.offsets, shape.parent, views.slot_of[row], views.occupant[row],
        memory.last_seen[row], memory.hops[row], memory.rel[row],
    )  # fmt: skip


@kernel
def before_policy(tick: int, arrays: TickArrays) -> bool:
    """Perceive, aim, observe and ask the swap triggers, for every awake row.

    Returns:
        Whether any row's slot protocol has something to attend to (``arrays.work.news``).
    """
    rules, shape, views, work = (
        arrays.rules,
        borrowed(arrays.shape),
        borrowed(arrays.views),
        borrowed(arrays.work),
    )
    sensed, frames, memory = borrowed(arrays.sensed), borrowed(arrays.frames), borrowed(arrays.memory)
    found = False
    for row in range(work.me.shape[0]):
        work.news[row] = False
        if not work.awake[row]:
            continue
        place_target(tick, row, rules.target_mps, work)
        perceive_row(tick, row, rules, work, sensed, frames, memory)
        _aim_and_observe(row, rules, shape, views, work, sensed, memory)
        if rules.swap_rule != trigger.OFF:
            _ask_triggers(tick, row, rules, shape, views, work, memory)
        news = views.busy[row] or work.partner[row] != trigger.NOBODY or work.vacated[row] != trigger.NOBODY
        for place in range(work.inbox_start[row], work.inbox_start[row + 1]):
            index = work.inbox[place]
            news |= frames.loud[index] != 0 or frames.digest[index] != views.digest[row]
        work.news[row] = news
        found |= news
    return found


@kernel
def aim_again(arrays: TickArrays) -> None:
    """Targets and observations after a view of the slots has changed."""
    rules, shape, views = arrays.rules, borrowed(arrays.shape), borrowed(arrays.views)
    work, sensed, memory = borrowed(arrays.work), borrowed(arrays.sensed), borrowed(arrays.memory)
    for row in range(work.me.shape[0]):
        if work.awake[row]:
            _aim_and_observe(row, rules, shape, views, work, sensed, memory)


@kernel
def after_policy(tick: int, first: int, arrays: TickArrays, command: NDArray[np.float64]) -> None:
    """Make the commands (A, 2) safe in place, and compose the frames that are due into ``arrays.frames`` row first + r.

    A policy that wants what is no number, or an absurd one, wants nothing. Drones take turns at low frame rates, so that not
    all speak in the same tick.
    """
    rules, views, work = arrays.rules, borrowed(arrays.views), borrowed(arrays.work)
    sensed, frames, memory = borrowed(arrays.sensed), borrowed(arrays.frames), borrowed(arrays.memory)
    for row in range(work.me.shape[0]):
        work.sent[row] = work.awake[row] and (tick + work.me[row]) % rules.frame_every == 0
        if not work.awake[row]:
            continue
        ax, ay = command[row, 0], command[row, 1]
        if not (abs(ax) <= ABSURD_MPS2 and abs(ay) <= ABSURD_MPS2):
            ax, ay = 0.0, 0.0
        if rules.detour:
            ax, ay = leave_pocket(ax, ay, row, rules, work, sensed, memory)
        if rules.filtered:
            ax, ay = safety_filter(
                ax, ay, sensed.motion[row, 2], sensed.motion[row, 3], memory.near_count[row], memory.near_rel[row],
                memory.near_vel[row], memory.disc_count[row], memory.obstacle_rel[row], memory.obstacle_radius[row],
                rules.limits,
            )  # fmt: skip
        command[row, 0], command[row, 1] = ax, ay
        if work.sent[row]:
            compose_row(tick, row, first + row, views.slot[row], rules, work, sensed, frames, memory)
            frames.digest[first + row] = views.digest[row]
            frames.loud[first + row] = 0
