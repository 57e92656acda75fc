"""What a drone with a valid login can say by radio that is not so, and that others will read: each lie is a function of what it
would honestly have said, and its first line says what it tells.

All are well-formed frames in the drone's own name: what is not is dropped by whoever reads it, as though it had been lost. None
needs the drone's key: a swap under its own seal is a lie that only the drone itself can tell (rsc_swarm.selfcheck.attacks).
"""

import struct
from collections.abc import Callable, Sequence
from typing import NamedTuple

import msgpack
import numpy as np

from protocols.slots.history import Swap, pack_swap
from protocols.slots.notes import Assignment, SlotNote, encode
from protocols.slots.seals import Sealed
from protocols.wire.frames import AGE_WINDOW, FIXED, OBSERVATION_SIZE, altered, parts_of

ECHO_TICKS = 100  #: how far back `replay` reaches

assert FIXED.fields is not None
_MOTION, _AGES, _DIGEST, _OBSERVATION = (
    FIXED.fields[name][1] for name in ("motion", "ages", "digest", "observation")
)
_ASIDE_M = 3.0


class Honest(NamedTuple):
    """What a drone would say now.

    me, agents: who, of how many. frame: its bytes. random: whose numbers the liar may use. seal: the liar's own on a text, or one
    that nobody believes. earlier: its honest frames of the last `ECHO_TICKS`, the oldest first.
    """

    me: int
    agents: int
    tick: int
    frame: bytes
    random: np.random.Generator
    seal: Callable[[bytes], bytes]
    earlier: Sequence[bytes] = ()


Lie = Callable[[Honest], bytes]


def position(honest: Honest) -> bytes:
    """it is three metres to the left of where it is"""
    x, y, vx, vy = struct.unpack_from("<4f", honest.frame, _MOTION)
    return _patched(honest.frame, _MOTION, struct.pack("<4f", x, y + _ASIDE_M, vx, vy))


def impossible_motion(honest: Honest) -> bytes:
    """it is where nobody can be so soon, at speeds that nothing has"""
    # numpy's `uniform` rounds otherwise with FMA
    place, speed = 100 * honest.random.random(2) - 50, honest.random.choice([3e38, -1e6, 500.0, 0.0], 2)
    return _patched(honest.frame, _MOTION, struct.pack("<4f", *place, *speed))


def displacement(honest: Honest) -> bytes:
    """all whom it knows are on its other side"""
    told = parts_of(honest.frame).displacement
    numbers = struct.unpack(f"<{len(told) // 4}f", told)
    mirrored = struct.pack(f"<{len(numbers)}f", *(-number for number in numbers))
    return altered(honest.frame, displacement=mirrored) if told else honest.frame


def observation(honest: Honest) -> bytes:
    """what it sees is noise"""
    return _patched(honest.frame, _OBSERVATION, honest.random.bytes(2 * OBSERVATION_SIZE))


def all_alive(honest: Honest) -> bytes:
    """it has just heard everybody, the dead too"""
    return _patched(honest.frame, _AGES, bytes(AGE_WINDOW))


def digest(honest: Honest) -> bytes:
    """it knows swaps that nobody has made, others in every frame"""
    return _patched(altered(honest.frame, note=b""), _DIGEST, honest.random.bytes(8))


def replay(honest: Honest) -> bytes:
    """what it said of the slots a second ago is what it says now"""
    if not honest.earlier:
        return honest.frame
    then = parts_of(honest.earlier[0])
    frame = altered(honest.frame, note=then.note)
    return _patched(frame, _DIGEST, then.fixed[_DIGEST : _DIGEST + 8])


def forged_swaps(honest: Honest) -> bytes:
    """two others have changed slots, which neither of them has done"""
    others = [other for other in range(honest.agents) if other != honest.me]
    if len(others) < 2:
        return honest.frame
    a, b = honest.random.permutation(others)[:2].tolist()
    op = Swap(max(honest.tick, 1), a, _number(honest, 5), a, b, b)
    forged = Sealed(op, 2 * honest.seal(pack_swap(op)))
    note = SlotNote(_number(honest, 8), settled=False, ops=(forged,))
    return altered(honest.frame, note=packed(note))


def forged_checkpoint(honest: Honest) -> bytes:
    """ten thousand swaps were made, after which all drones have changed places"""
    slots = tuple(honest.random.permutation(honest.agents).tolist())
    whole = Assignment(slots, 10_000 + honest.tick, honest.me)
    note = SlotNote(_number(honest, 8), settled=True, whole=whole)
    return altered(honest.frame, note=packed(note))


_ALL: tuple[Lie, ...] = (
    position, impossible_motion, displacement, observation, all_alive, digest, replay, forged_swaps, forged_checkpoint,
)  # fmt: skip
LIES: dict[str, Lie] = {lie.__name__.replace("_", "-"): lie for lie in _ALL}


def says(name: str) -> str:
    """What this lie tells."""
    return str(LIES[name].__doc__)


def packed(note: SlotNote) -> bytes:
    """A note as it travels behind its frame."""
    data: bytes = msgpack.packb(encode(note))
    return data


def _number(honest: Honest, size: int) -> int:
    """Any number of so many bytes."""
    return int.from_bytes(honest.random.bytes(size), "little")


def _patched(frame: bytes, place: int, data: bytes) -> bytes:
    return frame[:place] + data + frame[place + len(data) :]
