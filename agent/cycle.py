"""The two compiled halves of a drone's tick: all that comes before the policy, and all that comes after it.

Between them stand the slot protocol (only when there is news) and the policy, which are Python. Arrays are passed one by
one and regrouped inside, because handing a kernel a named tuple costs more than handing it its members.
"""

import numpy as np
from numpy.typing import NDArray

from agent.control.gains import SafetyLimits
from agent.control.safety import safety_filter
from agent.memory import Memory
from agent.observation import aim_row, observe_row
from agent.perceive import compose_row, perceive_row
from protocols import trigger
from protocols.frames import Frames
from protocols.kernels import kernel
from protocols.sensed import Sensed

_SENSED, _FRAMES, _MEMORY = len(Sensed._fields), len(Frames._fields), len(Memory._fields)
_F, _M, _END = _SENSED, _SENSED + _FRAMES, _SENSED + _FRAMES + _MEMORY
_SENSED_MEMORY = _SENSED + _MEMORY


@kernel
def before_policy(
    tick: int,
    awake: NDArray[np.bool_],
    me: NDArray[np.int64],
    inbox_start: NDArray[np.int64],
    inbox: NDArray[np.int64],
    by_sensor: bool,
    remember_obstacles: bool,
    keep: int,
    range_m: float,
    reach: float,
    max_hops: int,
    chain: bool,
    rule: int,
    margin: float,
    connected: bool,
    silent: int,
    offsets: NDArray[np.float64],
    parent: NDArray[np.int16],
    depth: NDArray[np.int64],
    slot_of: NDArray[np.int64],
    occupant: NDArray[np.int64],
    digest: NDArray[np.uint64],
    busy: NDArray[np.bool_],
    chain_error: NDArray[np.float64],
    slot_error: NDArray[np.float64],
    observation: NDArray[np.float64],
    partner: NDArray[np.int64],
    vacated: NDArray[np.int64],
    news: NDArray[np.bool_],
    *arrays: NDArray[np.float64],
) -> bool:
    """Perceive, aim, observe and ask the swap triggers, for every awake row; ``arrays`` are Sensed + Frames + Memory.

    Returns:
        Whether any row's slot protocol has something to attend to (``news``).
    """
    sensed, frames, memory = Sensed(*arrays[:_F]), Frames(*arrays[_F:_M]), Memory(*arrays[_M:_END])
    found = False
    for row in range(me.shape[0]):
        news[row] = False
        if not awake[row]:
            continue
        perceive_row(
            tick, row, me[row], sensed, frames, inbox_start, inbox, by_sensor, remember_obstacles, keep, range_m, max_hops, memory
        )
        aim_row(row, me[row], chain, sensed, memory, offsets, parent, slot_of, occupant, chain_error, slot_error)
        observe_row(row, reach, sensed, memory, slot_error, observation)
        partner[row], vacated[row] = trigger.NOBODY, trigger.NOBODY
        if rule != trigger.OFF:
            ex, ey = chain_error[row, 0], chain_error[row, 1]
            partner[row] = trigger.swap_partner(
                me[row], tick, rule, margin, connected, keep, range_m, ex, ey, offsets, parent, depth, slot_of[row],
                occupant[row], memory.heard_tick[row], memory.hops[row], memory.rel[row],
            )  # fmt: skip
            vacated[row] = trigger.vacancy_to_fill(
                me[row], tick, silent, ex, ey, offsets, parent, slot_of[row], occupant[row], memory.last_seen[row],
                memory.hops[row], memory.rel[row],
            )  # fmt: skip
        news[row] = busy[row] or partner[row] != trigger.NOBODY or vacated[row] != trigger.NOBODY
        for index in range(inbox_start[row], inbox_start[row + 1]):
            news[row] |= frames.loud[inbox[index]] or frames.digest[inbox[index]] != digest[row]
        found |= news[row]
    return found


@kernel
def aim_again(
    awake: NDArray[np.bool_],
    me: NDArray[np.int64],
    chain: bool,
    reach: float,
    offsets: NDArray[np.float64],
    parent: NDArray[np.int16],
    slot_of: NDArray[np.int64],
    occupant: NDArray[np.int64],
    chain_error: NDArray[np.float64],
    slot_error: NDArray[np.float64],
    observation: NDArray[np.float64],
    *arrays: NDArray[np.float64],
) -> None:
    """Targets and observations after a view of the slots has changed; ``arrays`` are Sensed + Memory."""
    sensed, memory = Sensed(*arrays[:_F]), Memory(*arrays[_F:_SENSED_MEMORY])
    for row in range(me.shape[0]):
        if awake[row]:
            aim_row(row, me[row], chain, sensed, memory, offsets, parent, slot_of, occupant, chain_error, slot_error)
            observe_row(row, reach, sensed, memory, slot_error, observation)


@kernel
def after_policy(
    tick: int,
    awake: NDArray[np.bool_],
    me: NDArray[np.int64],
    slot: NDArray[np.int64],
    digest: NDArray[np.uint64],
    max_hops: int,
    frame_every: int,
    first: int,
    filtered: bool,
    limits: SafetyLimits,
    observation: NDArray[np.float64],
    command: NDArray[np.float64],
    sent: NDArray[np.bool_],
    *arrays: NDArray[np.float64],
) -> None:
    """Make the commands safe and compose the frames that are due; ``arrays`` are Sensed + Frames + Memory.

    Drones take turns at low frame rates, so that not all speak in the same tick.
    """
    sensed, frames, memory = Sensed(*arrays[:_F]), Frames(*arrays[_F:_M]), Memory(*arrays[_M:_END])
    for row in range(me.shape[0]):
        sent[row] = awake[row] and (tick + me[row]) % frame_every == 0
        if awake[row] and filtered:
            command[row, 0], command[row, 1] = safety_filter(
                command[row, 0], command[row, 1], sensed.motion[row, 2], sensed.motion[row, 3], memory.near_count[row],
                memory.near_rel[row], memory.near_vel[row], memory.disc_count[row], memory.obstacle_rel[row],
                memory.obstacle_radius[row], limits,
            )  # fmt: skip
        if sent[row]:
            turn = tick // frame_every
            compose_row(tick, row, me[row], slot[row], max_hops, turn, sensed, observation, memory, frames, first + row)
            frames.digest[first + row] = digest[row]
            frames.loud[first + row] = 0
