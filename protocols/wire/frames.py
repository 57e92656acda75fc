"""The broadcast frame: what a drone tells every drone in radio range, as rows of arrays and on the wire.

On the wire a frame is

    one FIXED record | numbers of the known drones | their displacements | relayed means | slot note

where the record says how many drones are known, the numbers are 16 bits each, the displacements pairs of float32. Relayed means
are there only if the record's version is `RELAYING`: what its neighbours observed and what theirs did (agent.relay), for the
policies that ask for it. The slot note, as msgpack, is there only if the record says that it is ``loud`` (protocols.slots.notes);
a quiet, settled note is no more than the record's ``digest``.
A receiver checks everything before it believes anything; a bad frame is counted by one of `REASONS` and dropped.

Rows of `Frames` are the decoded form. Drones in one process share the rows instead of packing them, and see exactly
what the wire would have carried: every field is stored in its wire type.
"""

import math
import zlib
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.kernels import inlined_kernel
from protocols.wire.rows import bytes_of, put_bytes, room

VERSION, RELAYING = 2, 3  # of a frame without and with relayed means
MAX_FRAME_BYTES = 1600
MAX_KNOWN = 64  # drones one frame can give displacements of
OBSERVATION_SIZE = 18
OBSERVATION_UNIT = 2048.0  # observation numbers travel as 16-bit fixed point, +-16
RELAYED = 2  # means that are passed on: over the sender's neighbours, and over theirs
AGE_WINDOW = 8  # silence ages told per frame, in turn over all drones
AGE_UNIT_TICKS = 10
AGE_NEVER = 255

REASONS = ("oversized", "malformed", "version", "foreign", "sender", "stale", "non-finite")
_OVERSIZED, _MALFORMED, _VERSION, _FOREIGN, _WRONG_SENDER, _STALE, _NON_FINITE = range(len(REASONS))

#: tick: of sending. digest: of the sender's swap set. motion: p [m], v [m/s] in the common local frame. observation: the paper's
#: X_i. ages: x 0.1 s since anyone the sender listens to heard drone age_from, age_from + 1, ... one_hop: so many of the known
#: drones, the first, are the sender's own neighbours, the rest two hops off.
FIXED = np.dtype(
    [
        ("version", "u1"),
        ("loud", "u1"),
        ("tag", "<u2"),
        ("tick", "<u4"),
        ("digest", "<u8"),
        ("motion", "<f4", (4,)),
        ("observation", "<i2", (OBSERVATION_SIZE,)),
        ("ages", "u1", (AGE_WINDOW,)),
        ("sender", "<u2"),
        ("slot", "<u2"),
        ("age_from", "<u2"),
        ("one_hop", "u1"),
        ("known_count", "u1"),
    ]
)
KNOWN_BYTES = 2 + 8  # of one known drone
RELAYED_BYTES = 2 * RELAYED * OBSERVATION_SIZE
_SIZE = FIXED.itemsize


class Frames(NamedTuple):
    """Rows of frames. ``fixed`` holds the records; the arrays after it, to ``known_count``, are views of its fields for kernels.

    loud: whether the note says more than the digest. known: (R, MAX_KNOWN) agent numbers the sender gives displacements of,
    nearest hop first. displacement: (R, MAX_KNOWN, 2) metres, that drone minus the sender. relayed: (R, RELAYED, 18) means of X.
    *_bytes: (R, ...) the same as they travel.
    """

    fixed: NDArray[np.void]
    version: NDArray[np.uint8]
    loud: NDArray[np.uint8]
    tag: NDArray[np.uint16]
    tick: NDArray[np.uint32]
    digest: NDArray[np.uint64]
    motion: NDArray[np.float32]
    observation: NDArray[np.int16]
    ages: NDArray[np.uint8]
    sender: NDArray[np.uint16]
    slot: NDArray[np.uint16]
    age_from: NDArray[np.uint16]
    one_hop: NDArray[np.uint8]
    known_count: NDArray[np.uint8]
    known: NDArray[np.uint16]
    displacement: NDArray[np.float32]
    relayed: NDArray[np.int16]
    fixed_bytes: NDArray[np.uint8]
    known_bytes: NDArray[np.uint8]
    displacement_bytes: NDArray[np.uint8]
    relayed_bytes: NDArray[np.uint8]


def empty_frames(rows: int, tag: int = 0) -> Frames:
    """Room for ``rows`` frames of the swarm with this ``tag``."""
    fixed = room((rows,), FIXED)
    fixed["version"], fixed["tag"] = VERSION, tag
    known, displacement = room((rows, MAX_KNOWN), np.uint16), room((rows, MAX_KNOWN, 2), np.float32)
    relayed = room((rows, RELAYED, OBSERVATION_SIZE), np.int16)
    assert FIXED.names is not None
    return Frames(
        fixed=fixed,
        **{name: fixed[name] for name in FIXED.names},
        known=known,
        displacement=displacement,
        relayed=relayed,
        fixed_bytes=fixed.view(np.uint8).reshape(rows, _SIZE),
        known_bytes=known.view(np.uint8),
        displacement_bytes=displacement.reshape(rows, -1).view(np.uint8),
        relayed_bytes=relayed.reshape(rows, -1).view(np.uint8),
    )


def swarm_tag(swarm: str) -> int:
    """Two bytes that tell this swarm's frames from another's on the same air."""
    return zlib.crc32(swarm.encode()) & 0xFFFF


class FrameWriter:
    """Rows of frames as they travel, by copying bytes: the records are the wire's own."""

    def __init__(self, frames: Frames) -> None:
        self._fixed, self._known = bytes_of(frames.fixed), bytes_of(frames.known)
        self._displacement, self._relayed = bytes_of(frames.displacement), bytes_of(frames.relayed)
        self._count, self._version = frames.known_count, frames.version

    def write(self, row: int, note: bytes = b"") -> bytes:
        """The bytes of one row; ``note``: its slot note, if the row is loud."""
        count, start, passed_on = int(self._count[row]), row * MAX_KNOWN, row * RELAYED_BYTES
        relays = self._version[row] == RELAYING
        return (
            self._fixed[row * _SIZE : (row + 1) * _SIZE].tobytes()
            + self._known[2 * start : 2 * (start + count)].tobytes()
            + self._displacement[8 * start : 8 * (start + count)].tobytes()
            + (self._relayed[passed_on : passed_on + RELAYED_BYTES].tobytes() if relays else b"")
            + note
        )


class Frame(NamedTuple):
    """A frame on the wire, in its parts."""

    fixed: bytes
    known: bytes
    displacement: bytes
    relayed: bytes
    note: bytes


def parts_of(data: bytes) -> Frame:
    """A frame as `FrameWriter` writes it, in its parts. Not for what anybody may have sent."""
    fixed = np.frombuffer(data, FIXED, 1)[0]
    known = _SIZE + 2 * int(fixed["known_count"])
    relayed = _SIZE + KNOWN_BYTES * int(fixed["known_count"])
    note = relayed + (RELAYED_BYTES if fixed["version"] == RELAYING else 0)
    return Frame(data[:_SIZE], data[_SIZE:known], data[known:relayed], data[relayed:note], data[note:])


def altered(data: bytes, **instead: bytes) -> bytes:
    """A frame as `parts_of` takes it, with other parts; it is loud if it has a note. For tests and rehearsed attacks."""
    parts = parts_of(data)._replace(**instead)
    loud = FIXED.fields["loud"][1] if FIXED.fields else 0
    fixed = parts.fixed[:loud] + bytes([parts.note != b""]) + parts.fixed[loud + 1 :]
    return b"".join((fixed, *parts[1:]))


@inlined_kernel
def body_bytes(frames: Frames, row: int) -> int:
    """Size of the frame in ``row`` but for its slot note."""
    relayed = RELAYED_BYTES if frames.version[row] == RELAYING else 0
    return _SIZE + KNOWN_BYTES * int(np.int64(frames.known_count[row])) + relayed


@inlined_kernel
def put_frame(frames: Frames, row: int, data: NDArray[np.uint8], at: int) -> int:
    """Write the frame in ``row``, but for its slot note, into ``data`` from ``at`` on.

    Returns:
        Its size.
    """
    count = int(np.int64(frames.known_count[row]))
    displacement = at + _SIZE + 2 * count
    put_bytes(data, at, frames.fixed_bytes[row], 0, _SIZE)
    put_bytes(data, at + _SIZE, frames.known_bytes[row], 0, 2 * count)
    put_bytes(data, displacement, frames.displacement_bytes[row], 0, 8 * count)
    if frames.version[row] == RELAYING:
        put_bytes(data, displacement + 8 * count, frames.relayed_bytes[row], 0, RELAYED_BYTES)
    return body_bytes(frames, row)


@inlined_kernel
def read_frame(data: NDArray[np.uint8], at: int, size: int, tag: int, frames: Frames, row: int) -> int:
    """Write the frame in ``size`` bytes of ``data`` from ``at`` on into ``row``; what it says is still to be checked (`fault`),
    and so is the note behind it, if it is loud.

    Returns:
        Why it is no frame of this swarm, as an index of `REASONS`; -1 if it is one.
    """
    if size > MAX_FRAME_BYTES:
        return _OVERSIZED
    if size < _SIZE:
        return _MALFORMED
    put_bytes(frames.fixed_bytes[row], 0, data, at, _SIZE)
    count = int(np.int64(frames.known_count[row]))
    if frames.version[row] != VERSION and frames.version[row] != RELAYING:
        return _VERSION
    if frames.tag[row] != tag:
        return _FOREIGN
    known, displacement = at + _SIZE, at + _SIZE + 2 * count
    whole, loud = body_bytes(frames, row), frames.loud[row]
    if count > MAX_KNOWN or loud > 1 or size < whole or (size > whole) != (loud == 1):
        return _MALFORMED
    put_bytes(frames.known_bytes[row], 0, data, known, 2 * count)
    put_bytes(frames.displacement_bytes[row], 0, data, displacement, 8 * count)
    if frames.version[row] == RELAYING:
        put_bytes(frames.relayed_bytes[row], 0, data, displacement + 8 * count, RELAYED_BYTES)
    return -1


@inlined_kernel
def fault(frames: Frames, row: int, now: int, oldest: int, agents: int) -> int:
    """Why the frame in ``row``, heard at tick ``now``, must not be believed, as an index of `REASONS`; -1 if it may be.

    Args:
        oldest: ticks; a frame older than this, or from the future, is stale.
    """
    count, tick = np.int64(frames.known_count[row]), np.int64(frames.tick[row])
    if frames.one_hop[row] > count or frames.slot[row] >= agents or frames.age_from[row] >= agents:
        return _MALFORMED
    highest, total = np.int64(frames.sender[row]), 0.0
    for place in range(4):
        total += frames.motion[row, place]
    for entry in range(count):
        highest = max(highest, np.int64(frames.known[row, entry]))
        total += frames.displacement[row, entry, 0]
        total += frames.displacement[row, entry, 1]
    if highest >= agents:
        return _WRONG_SENDER
    if not now - oldest <= tick < now:
        return _STALE
    # A sum of float32 numbers in double precision is finite if and only if every one is.
    if not math.isfinite(total):
        return _NON_FINITE
    return -1
