"""The broadcast frame: what a drone tells every drone in radio range, as rows of arrays and on the wire.

On the wire a frame is one msgpack array

    [VERSION, swarm tag, fixed part, known ids, known displacements, slot note]

where the fixed part is one `FIXED` record, the displacements are float32 pairs, and the slot note is protocols.slots.agreement's.
A receiver checks everything before it believes anything; `FrameError.reason` is one of `REASONS`, and a bad frame is
counted and dropped.

Rows of `Frames` are the decoded form. Drones in one process share the rows instead of packing them, and see exactly
what the wire would have carried: every field is stored in its wire type.
"""

import math
import zlib
from typing import Any, NamedTuple

import msgpack
import numpy as np
from numpy.typing import NDArray

from protocols.kernels import inlined_kernel
from protocols.wire.rows import bytes_of

VERSION = 1
MAX_FRAME_BYTES = 1536
MAX_KNOWN = 64  # drones one frame can give displacements of
OBSERVATION_SIZE = 18
OBSERVATION_UNIT = 2048.0  # observation numbers travel as 16-bit fixed point, +-16
AGE_WINDOW = 8  # silence ages told per frame, in turn over all drones
AGE_UNIT_TICKS = 10
AGE_NEVER = 255

REASONS = ("oversized", "malformed", "version", "foreign", "sender", "stale", "non-finite")
_MALFORMED, _WRONG_SENDER, _STALE, _NON_FINITE = (
    REASONS.index(reason) for reason in ("malformed", "sender", "stale", "non-finite")
)

FIXED = np.dtype(
    [
        ("tick", "<u4"),
        ("motion", "<f4", (4,)),  # p [m], v [m/s] in the common local frame
        ("observation", "<i2", (OBSERVATION_SIZE,)),  # the paper's X_i
        (
            "ages",
            "u1",
            (AGE_WINDOW,),
        ),  # x 0.1 s since anyone the sender listens to heard drone age_from, age_from+1, ...
        ("sender", "u1"),
        ("slot", "u1"),
        (
            "one_hop",
            "u1",
        ),  # the first one_hop of the known drones are the sender's own neighbours, the rest two hops off
        ("known_count", "u1"),
        ("age_from", "u1"),
    ]
)
assert FIXED.fields is not None
_SIZE, _SENDER, _COUNT = FIXED.itemsize, FIXED.fields["sender"][1], FIXED.fields["known_count"][1]


class FrameError(ValueError):
    """A frame that must not be believed."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class Frames(NamedTuple):
    """Rows of frames. ``fixed`` holds the records; the arrays after it are views of its fields for the kernels.

    known: (R, MAX_KNOWN) agent numbers the sender gives displacements of, nearest hop first.
    displacement: (R, MAX_KNOWN, 2) metres, that drone minus the sender.
    digest: (R,) of the sender's swap set; loud: (R,) whether its note says more than the digest.
    """

    fixed: NDArray[np.void]
    tick: NDArray[np.uint32]
    motion: NDArray[np.float32]
    observation: NDArray[np.int16]
    ages: NDArray[np.uint8]
    sender: NDArray[np.uint8]
    slot: NDArray[np.uint8]
    one_hop: NDArray[np.uint8]
    known_count: NDArray[np.uint8]
    age_from: NDArray[np.uint8]
    known: NDArray[np.uint8]
    displacement: NDArray[np.float32]
    digest: NDArray[np.uint64]
    loud: NDArray[np.uint8]


def empty_frames(rows: int) -> Frames:
    """Room for ``rows`` frames."""
    fixed = np.zeros(rows, FIXED)
    assert FIXED.names is not None
    views = {name: fixed[name] for name in FIXED.names}
    return Frames(
        fixed=fixed,
        **views,
        known=np.zeros((rows, MAX_KNOWN), np.uint8),
        displacement=np.zeros((rows, MAX_KNOWN, 2), np.float32),
        digest=np.zeros(rows, np.uint64),
        loud=np.zeros(rows, np.uint8),
    )


def swarm_tag(swarm: str) -> int:
    """Two bytes that tell this swarm's frames from another's on the same air."""
    return zlib.crc32(swarm.encode()) & 0xFFFF


class FrameCodec:
    """Rows of frames to and from the wire, by copying bytes: the records are the wire's own."""

    def __init__(self, tag: int, frames: Frames) -> None:
        self._tag = tag
        self._fixed, self._known = bytes_of(frames.fixed), bytes_of(frames.known)
        self._displacement = bytes_of(frames.displacement)

    def encode(self, row: int, note: Any) -> bytes:
        """The bytes of one row; ``note`` is an encoded slot note (protocols.slots.agreement)."""
        fixed = self._fixed[row * _SIZE : (row + 1) * _SIZE].tobytes()
        start = row * MAX_KNOWN
        end = start + fixed[_COUNT]
        known = self._known[start:end].tobytes()
        displacement = self._displacement[8 * start : 8 * end].tobytes()
        packed: bytes = msgpack.packb((VERSION, self._tag, fixed, known, displacement, note))
        return packed

    def decode(self, data: bytes, row: int) -> tuple[int, Any]:
        """Write a frame into ``row``; return its sender and its slot note. What it says is still to be checked (`fault`).

        Raises:
            FrameError: it is no frame of this swarm; the row is then not to be used.
        """
        if len(data) > MAX_FRAME_BYTES:
            raise FrameError("oversized")
        try:
            version, tag, fixed, known, displacement, note = msgpack.unpackb(data)
            if version != VERSION:
                raise FrameError("version")
            if tag != self._tag:
                raise FrameError("foreign")
            self._fixed[row * _SIZE : (row + 1) * _SIZE] = fixed
            count = fixed[_COUNT]
            if count > MAX_KNOWN:
                raise FrameError("malformed")
            start = row * MAX_KNOWN
            self._known[start : start + count] = known
            self._displacement[8 * start : 8 * (start + count)] = displacement
        except FrameError:
            raise
        except (ValueError, TypeError, msgpack.exceptions.UnpackException) as error:
            raise FrameError("malformed") from error
        return fixed[_SENDER], note


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
