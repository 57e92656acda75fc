"""A drone's tick in one compiled call, from the Tick that came to the Reply that goes, wherever nothing rare happens.

Twenty-five drones on two cores find nothing of their own in the processor's caches when they wake, so what a tick costs is how
much code and memory it touches. What is rare is left to agent.process: a swap, a frame that is not believed or says more of
slots, an answer that came late. Whatever has been done by then may be done again.

A compiled policy (agent.policy.base.Compiled) has a kernel of its own for it:

    tick = begin_tick(quick)
    if tick < 0:
        return RARE
    ...                               what the policy wants, into quick.command
    return end_tick(tick, quick)
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.body.foresight import Commands
from agent.radio.hearing import Ears, entry_end, hear_entry
from agent.tick import perceive_all, secure_all
from agent.tick_arrays import TickArrays
from protocols.kernels import inlined_kernel
from protocols.wire.frames import put_frame
from protocols.wire.messages import MAX_HEARD, REPLY_AT, REPLY_HEAD, REPLY_MARK, TICK_AT, TICK_HEAD, TICK_MARK
from protocols.wire.rows import get_number, put_bytes, put_number
from protocols.wire.sensed import DISC, MAX_NEAR, MAX_OBSTACLES, NEIGHBOUR, OWN_BYTES

RARE = -1
_VECTOR_BYTES = OWN_BYTES // 2
_TICK_HEAD, _REPLY_HEAD, _NEAR, _DISC = TICK_HEAD.size, REPLY_HEAD.size, NEIGHBOUR.itemsize, DISC.itemsize


class Quick(NamedTuple):
    """Everything a drone's tick works on. ``ears.data`` holds the Tick, of ``size`` (1,) bytes.

    *_bytes: what is sensed, and the command, as they travel. last: (1,) the last tick that was flown. answer: the Reply,
    out; where it would tell of an account it stays 0. telling: (1,) whether it tells of plans, too, to those who look on.
    """

    process: int
    size: NDArray[np.int64]
    arrays: TickArrays
    ears: Ears
    position_bytes: NDArray[np.uint8]
    velocity_bytes: NDArray[np.uint8]
    near_bytes: NDArray[np.uint8]
    obstacles_bytes: NDArray[np.uint8]
    command: NDArray[np.float64]
    command_bytes: NDArray[np.uint8]
    commands: Commands
    last: NDArray[np.int64]
    answer: NDArray[np.uint8]
    telling: NDArray[np.bool_]


@inlined_kernel
def tick_of(quick: Quick) -> int:
    """The tick that the message is of, if it is a Tick."""
    return get_number(quick.ears.data, TICK_AT.tick, 4)


@inlined_kernel
def begin_tick(quick: Quick) -> int:
    """Read the Tick, sense, hear and perceive.

    Returns:
        The tick; `RARE` where it is to be done in the ordinary way.
    """
    said, sensed, size = quick.ears.data, quick.arrays.sensed, quick.size[0]
    if size < _TICK_HEAD or said[TICK_AT.mark] != TICK_MARK:
        return RARE
    obstacles, near = get_number(said, TICK_AT.obstacles, 1), get_number(said, TICK_AT.near, 2)
    tick, heard = tick_of(quick), get_number(said, TICK_AT.heard, 4)
    near_at = _TICK_HEAD + OWN_BYTES
    obstacles_at = near_at + near * _NEAR
    at = obstacles_at + obstacles * _DISC
    late = get_number(said, TICK_AT.followed, 4) != tick - 1
    if late or tick <= quick.last[0]:
        return RARE
    if near > MAX_NEAR or obstacles > MAX_OBSTACLES or at > size or heard > MAX_HEARD:
        return RARE
    put_bytes(quick.position_bytes, 0, said, _TICK_HEAD, _VECTOR_BYTES)
    put_bytes(quick.velocity_bytes, 0, said, _TICK_HEAD + _VECTOR_BYTES, _VECTOR_BYTES)
    put_bytes(quick.near_bytes, 0, said, near_at, obstacles_at - near_at)
    put_bytes(quick.obstacles_bytes, 0, said, obstacles_at, at - obstacles_at)
    sensed.near_count[0], sensed.obstacle_count[0] = near, obstacles
    for row in range(heard):
        beyond = entry_end(at, size, said)
        if beyond < 0 or hear_entry(tick, at, beyond, row, quick.ears) >= 0 or quick.ears.frames.loud[row]:
            return RARE
        quick.ears.believed[row] = row
        at = beyond
    quick.arrays.work.inbox_start[1] = heard
    return RARE if perceive_all(tick, False, quick.arrays) else tick


@inlined_kernel
def end_tick(tick: int, quick: Quick) -> int:
    """Make the command safe, compose the frame, if one is due, and write the Reply.

    Returns:
        Its size; `RARE` where it is to be done in the ordinary way.
    """
    answer, arrays, own = quick.answer, quick.arrays, MAX_HEARD
    if secure_all(tick, own, arrays, quick.command) >= 0:
        return RARE
    frame_size = put_frame(arrays.frames, own, answer, _REPLY_HEAD) if arrays.work.sent[0] else 0
    put_number(answer, REPLY_AT.mark, REPLY_MARK, 1)
    put_number(answer, REPLY_AT.process, quick.process, 4)
    put_number(answer, REPLY_AT.tick, tick, 4)
    put_bytes(answer, REPLY_AT.proof, quick.ears.data, TICK_AT.proof, 4)
    put_number(answer, REPLY_AT.slot, arrays.views.slot[0], 2)
    put_number(answer, REPLY_AT.frame_size, frame_size, 2)
    put_number(answer, REPLY_AT.plan_size, 0, 2)
    put_bytes(answer, REPLY_AT.ax, quick.command_bytes, 0, 16)
    place = tick % quick.commands.tick.shape[0]
    quick.commands.tick[place] = tick
    quick.commands.on_time[0] += 1
    for axis in range(2):
        quick.commands.command[place, axis] = quick.command[0, axis]
    quick.last[0] = tick
    return _REPLY_HEAD + frame_size
