"""The two compiled halves of a drone's tick: all that comes before the policy, and all that comes after it.

Between them stand the slot protocol (only when there is news) and the policy, which are Python.
"""

import numpy as np
from numpy.typing import NDArray

from agent.control.detour import leave_pocket
from agent.control.safety import safety_filter
from agent.heard import listens, stand_still
from agent.memory import Memory, discs_of, neighbours_of, within_of
from agent.observation import aim_row, observe_row
from agent.perceive import compose_row, perceive_row
from agent.target import place_target
from agent.tick_arrays import Rules, TickArrays, Views, Work
from protocols.dynamics import ABSURD_MPS2, vector
from protocols.kernels import inlined_kernel, kernel
from protocols.slots import trigger
from protocols.slots.trigger import Shape


@inlined_kernel
def _ask_triggers(
    tick: int, row: int, rules: Rules, shape: Shape, views: Views, work: Work, memory: Memory
) -> None:
    error = vector(work.chain_error, row)
    known = trigger.Known(
        views.slot_of[row], views.occupant[row], memory.heard_tick[row], memory.last_seen[row], memory.hops[row],
        memory.rel[row], within_of(memory, row),
    )  # fmt: skip
    me = work.me[row]
    work.partner[row] = trigger.swap_partner(me, tick, rules.swap, rules.radio, error, shape, known)
    work.vacated[row] = trigger.vacancy_to_fill(me, tick, rules.swap, rules.radio, error, shape, known)


@inlined_kernel
def perceive_all(tick: int, again: bool, arrays: TickArrays) -> bool:
    """Perceive, aim, observe and ask the swap triggers, for every awake row. Done again for the same tick it changes nothing.

    Args:
        again: only aim and observe, after a view of the slots has changed.

    Returns:
        Whether any row's slot protocol has something to attend to (``arrays.work.news``).
    """
    rules, shape, views, work = arrays.rules, arrays.shape, arrays.views, arrays.work
    sensed, frames, memory = arrays.sensed, arrays.frames, arrays.memory
    found = False
    for row in range(work.me.shape[0]):
        if not work.awake[row]:
            work.news[row] = False
            continue
        if not again:
            place_target(tick, row, rules.target_mps, work)
            perceive_row(tick, row, rules, work, sensed, frames, memory)
        aim_row(row, rules.chain, shape, views, work, sensed, memory)
        observe_row(row, rules.reach_m, work, sensed, memory, work.observation[row])
        if again:
            continue
        if rules.swap.rule != trigger.OFF:
            _ask_triggers(tick, row, rules, shape, views, work, memory)
        news = views.busy[row] or work.partner[row] != trigger.NOBODY or work.vacated[row] != trigger.NOBODY
        for place in range(work.inbox_start[row], work.inbox_start[row + 1]):
            index = work.inbox[place]
            news |= frames.loud[index] != 0 or frames.digest[index] != views.digest[row]
        work.news[row] = news
        found |= news
    return found


@kernel
def before_policy(tick: int, again: bool, arrays: TickArrays) -> bool:
    """`perceive_all`."""
    return perceive_all(tick, again, arrays)


@inlined_kernel
def secure_all(tick: int, first: int, arrays: TickArrays, command: NDArray[np.float64]) -> int:
    """Make the commands (A, 2) safe in place, and compose the frames that are due into ``arrays.frames`` row first + r.

    Drones take turns at low frame rates, so that not all speak in the same tick.

    Returns:
        The first row of which the policy wants what is no number, or an absurd one; then nothing is done from there on. Else -1.
    """
    rules, views, work = arrays.rules, arrays.views, arrays.work
    sensed, frames, memory = arrays.sensed, arrays.frames, arrays.memory
    for row in range(work.me.shape[0]):
        work.sent[row] = work.awake[row] and (tick + work.me[row]) % rules.frame_every == 0
        if not work.awake[row]:
            continue
        wanted = vector(command, row)
        if not (abs(wanted[0]) <= ABSURD_MPS2 and abs(wanted[1]) <= ABSURD_MPS2):
            return row
        if listens(tick, row, rules, memory):
            wanted = stand_still(vector(sensed.velocity, row))
        elif rules.detour:
            wanted = leave_pocket(wanted, row, rules, work, sensed, memory)
        if rules.filtered:
            near, discs = neighbours_of(memory, row), discs_of(memory, row)
            wanted = safety_filter(wanted, vector(sensed.velocity, row), near, discs, rules.limits)
        command[row, 0], command[row, 1] = wanted
        if work.sent[row]:
            compose_row(tick, row, first + row, rules, work, sensed, frames, memory)
            frames.slot[first + row] = views.slot[row]
            frames.digest[first + row] = views.digest[row]
            frames.loud[first + row] = 0
    return -1


@kernel
def after_policy(tick: int, first: int, arrays: TickArrays, command: NDArray[np.float64]) -> int:
    """`secure_all`."""
    return secure_all(tick, first, arrays, command)
