"""A drone's tick in one compiled call, from the Tick that came to the Reply that goes, wherever nothing rare happens.

Twenty-five drones on two cores find nothing of their own in the processor's caches when they wake, so what a tick costs is how
much code and memory it touches. What is rare is left to agent.process: a swap, a frame that is not believed or says more of
slots, an account or a plan that is due, an answer that came late. Whatever has been done by then may be done again.

A compiled policy (agent.policy.base.Compiled) has a kernel of its own for it:

    tick = begin_tick(size, quick)
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
from protocols.wire.frames import KNOWN_BYTES
from protocols.wire.messages import MAX_HEARD, REPLY_HEAD, REPLY_MARK, TICK_HEAD, TICK_MARK
from protocols.wire.sensed import DISC, MAX_NEAR, MAX_OBSTACLES, NEIGHBOUR, OWN_BYTES
from protocols.wire.status import STATUS_EVERY

RARE = -1
_TICK_AT, _PROOF_AT, _FOLLOWED_AT, _HEARD_AT = (
    4,
    8,
    12,
    16,
)  # in a Tick; protocols.wire.messages has the layout
_VECTOR_BYTES = OWN_BYTES // 2
_TICK_HEAD, _REPLY_HEAD, _NEAR, _DISC = TICK_HEAD.size, REPLY_HEAD.size, NEIGHBOUR.itemsize, DISC.itemsize


class Quick(NamedTuple):
    """Everything a drone's tick works on. ``ears.data`` holds the Tick.

    *_bytes: what is sensed, and the command, as they travel. last: (1,) the last tick that was flown. answer: the Reply, out.
    """

    process: int
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


@inlined_kernel
def _get(data: NDArray[np.uint8], at: int, size: int) -> int:
    value = 0
    for place in range(size):
        value += int(np.int64(data[at + place])) << (8 * place)
    return value


@inlined_kernel
def _put(data: NDArray[np.uint8], at: int, value: int, size: int) -> None:
    for place in range(size):
        data[at + place] = (value >> (8 * place)) & 255


@inlined_kernel
def _copy(source: NDArray[np.uint8], begin: int, target: NDArray[np.uint8], at: int, size: int) -> None:
    for place in range(size):
        target[at + place] = source[begin + place]


@inlined_kernel
def tick_of(quick: Quick) -> int:
    """The tick that the message is of, if it is a Tick."""
    return _get(quick.ears.data, _TICK_AT, 4)


@inlined_kernel
def begin_tick(size: int, quick: Quick) -> int:
    """Read the Tick in ``size`` bytes, sense, hear and perceive.

    Returns:
        The tick; `RARE` where it is to be done in the ordinary way.
    """
    said, sensed = quick.ears.data, quick.arrays.sensed
    if size < _TICK_HEAD or said[0] != TICK_MARK:
        return RARE
    obstacles, near = _get(said, 1, 1), _get(said, 2, 2)
    tick, heard = tick_of(quick), _get(said, _HEARD_AT, 4)
    near_at = _TICK_HEAD + OWN_BYTES
    obstacles_at = near_at + near * _NEAR
    at = obstacles_at + obstacles * _DISC
    late = _get(said, _FOLLOWED_AT, 4) != tick - 1
    if late or tick <= quick.last[0] or tick % STATUS_EVERY == 0:
        return RARE
    if near > MAX_NEAR or obstacles > MAX_OBSTACLES or at > size or heard > MAX_HEARD:
        return RARE
    _copy(said, _TICK_HEAD, quick.position_bytes, 0, _VECTOR_BYTES)
    _copy(said, _TICK_HEAD + _VECTOR_BYTES, quick.velocity_bytes, 0, _VECTOR_BYTES)
    _copy(said, near_at, quick.near_bytes, 0, obstacles_at - near_at)
    _copy(said, obstacles_at, quick.obstacles_bytes, 0, at - obstacles_at)
    sensed.near_count[0], sensed.obstacle_count[0] = near, obstacles
    for row in range(heard):
        beyond = entry_end(at, size, said)
        if beyond < 0 or hear_entry(tick, at, beyond, row, quick.ears) >= 0 or quick.ears.frames.loud[row]:
            return RARE
        quick.ears.believed[row] = row
        at = beyond
    quick.arrays.work.inbox_start[1] = heard
    return RARE if perceive_all(tick, quick.arrays) else tick


@inlined_kernel
def end_tick(tick: int, quick: Quick) -> int:
    """Make the command safe, compose the frame, if one is due, and write the Reply.

    Returns:
        Its size; `RARE` where it is to be done in the ordinary way.
    """
    answer, arrays, own = quick.answer, quick.arrays, MAX_HEARD
    if secure_all(tick, own, arrays, quick.command) >= 0:
        return RARE
    frames, at, frame_size = arrays.frames, _REPLY_HEAD, 0
    if arrays.work.sent[0]:
        known, fixed_size = int(np.int64(frames.known_count[own])), frames.fixed_bytes.shape[1]
        _copy(frames.fixed_bytes[own], 0, answer, at, fixed_size)
        _copy(frames.known_bytes[own], 0, answer, at + fixed_size, 2 * known)
        _copy(frames.displacement_bytes[own], 0, answer, at + fixed_size + 2 * known, 8 * known)
        frame_size = fixed_size + KNOWN_BYTES * known
    _put(answer, 0, REPLY_MARK, 4)
    _put(answer, 4, quick.process, 4)
    _put(answer, 8, tick, 4)
    _copy(quick.ears.data, _PROOF_AT, answer, 12, 4)
    _put(answer, 16, arrays.views.slot[0], 2)
    _put(answer, 18, frame_size, 2)
    _put(answer, 20, 0, 4)
    _copy(quick.command_bytes, 0, answer, 24, 16)
    place = tick % quick.commands.tick.shape[0]
    quick.commands.tick[place] = tick
    quick.commands.on_time[0] += 1
    for axis in range(2):
        quick.commands.command[place, axis] = quick.command[0, axis]
    quick.last[0] = tick
    return at + frame_size
