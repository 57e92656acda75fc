"""The broadcast frame: what a drone tells every drone in radio range, as rows of arrays and on the wire.

On the wire a frame is one msgpack array

    [VERSION, swarm tag, fixed part, known ids, known displacements, slot note]

where the fixed part is one `FIXED` record, the displacements are float32 pairs, and the slot note is protocols.swap's.
A receiver checks everything before it believes anything; `FrameError.reason` is one of `REASONS`, and a bad frame is
counted and dropped.

Rows of `Frames` are the decoded form. Drones in one process share the rows instead of packing them, and see exactly
what the wire would have carried: every field is stored in its wire type.
"""

import math
import struct
import zlib
from typing import Any, NamedTuple

import msgpack
import numpy as np
from numpy.typing import NDArray

VERSION = 1
MAX_FRAME_BYTES = 1536
MAX_KNOWN = 64  # drones one frame can give displacements of
OBSERVATION_SIZE = 18
OBSERVATION_UNIT = 2048.0  # observation numbers travel as 16-bit fixed point, +-16
AGE_WINDOW = 8  # silence ages told per frame, in turn over all drones
AGE_UNIT_TICKS = 10
AGE_NEVER = 255

# The fields of FIXED that a receiver checks: tick, motion, sender, slot, one_hop, known_count, age_from.
_CHECKED = struct.Struct(f"<I4f{2 * OBSERVATION_SIZE}x{AGE_WINDOW}x5B")

REASONS = ("oversized", "malformed", "version", "foreign", "sender", "stale", "non-finite")

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


def encode_frame(tag: int, frames: Frames, row: int, note: Any) -> bytes:
    """The bytes of one row; ``note`` is an encoded slot note (protocols.swap)."""
    count = int(frames.known_count[row])
    packed: bytes = msgpack.packb(
        (
            VERSION,
            tag,
            frames.fixed[row].tobytes(),
            frames.known[row, :count].tobytes(),
            frames.displacement[row, :count].tobytes(),
            note,
        )
    )
    return packed


class FrameReader:
    """Checks what is heard and writes it into rows of frames, by copying bytes: the records are the wire's own."""

    def __init__(self, tag: int, agents: int, frames: Frames) -> None:
        self._tag, self._agents = tag, agents
        self._fixed, self._known, self._displacement = (
            array.reshape(-1).view(np.uint8).data
            for array in (frames.fixed, frames.known, frames.displacement)
        )

    def read(self, data: bytes, now: int, oldest: int, row: int) -> tuple[int, Any]:
        """Check a frame heard at tick ``now`` and write it into ``row``; return its sender and its slot note, still unchecked.

        Args:
            oldest: ticks; a frame older than this, or from the future, is stale.

        Raises:
            FrameError: with the reason; the row is then not to be used.
        """
        if len(data) > MAX_FRAME_BYTES:
            raise FrameError("oversized")
        try:
            version, tag, fixed, known, displacement, note = msgpack.unpackb(data)
            if version != VERSION:
                raise FrameError("version")
            if tag != self._tag:
                raise FrameError("foreign")
            tick, *motion, sender, slot, one_hop, count, age_from = _CHECKED.unpack(fixed)
            steps = memoryview(displacement).cast("f")
            if type(known) is not bytes:
                raise TypeError("known drones are one byte each")
            known_ids = max(known, default=0)
        except FrameError:
            raise
        except (ValueError, TypeError, struct.error, msgpack.exceptions.UnpackException) as error:
            raise FrameError("malformed") from error
        if len(known) != count or len(steps) != 2 * count or not one_hop <= count <= MAX_KNOWN:
            raise FrameError("malformed")
        if slot >= self._agents or age_from >= self._agents:
            raise FrameError("malformed")
        if sender >= self._agents or known_ids >= self._agents:
            raise FrameError("sender")
        if not now - oldest <= tick < now:
            raise FrameError("stale")
        # A sum of float32 numbers in double precision is finite if and only if every one is.
        if not math.isfinite(sum(steps) + sum(motion)):
            raise FrameError("non-finite")
        size = FIXED.itemsize
        self._fixed[row * size : (row + 1) * size] = fixed
        start = row * MAX_KNOWN
        self._known[start : start + count] = known
        self._displacement[8 * start : 8 * (start + count)] = displacement
        return sender, note
