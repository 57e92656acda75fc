"""Frames on the air as rows, with the slot notes they carry, and as the bytes they travel as.

Drones of one process share the rows instead of packing and unpacking them; the rows hold exactly what the wire would carry.
"""

import msgpack
import numpy as np
from numpy.typing import NDArray

from protocols.slots.notes import SlotNote, decode, encode
from protocols.wire.frames import (
    FIXED,
    KNOWN_BYTES,
    RELAYED_BYTES,
    RELAYING,
    FrameWriter,
    empty_frames,
    parts_of,
    swarm_tag,
)


class Air:
    """Rows of frames of one swarm. ``frames`` are the rows, for kernels; a row's note is read and written here.

    A quiet, settled note is no more than the row's ``frames.digest``; only where ``frames.loud`` is there another.
    """

    def __init__(self, swarm: str, agents: int, rows: int) -> None:
        self.tag = swarm_tag(swarm)
        self.frames = empty_frames(rows, self.tag)
        self._agents = agents
        self._writer = FrameWriter(self.frames)
        self._loud = self.frames.loud.data  # quicker to index
        self._notes: dict[int, SlotNote] = {}

    def note(self, row: int) -> SlotNote:
        """What the frame says about slots."""
        return self._notes[row] if self._loud[row] else SlotNote(int(self.frames.digest[row]), settled=True)

    def put_note(self, row: int, note: SlotNote) -> None:
        """Let the frame say this about slots."""
        self.frames.digest[row], self._loud[row] = note.digest, not (note.settled and note.quiet)
        self._notes[row] = note

    def read_note(self, row: int, data: bytes) -> None:
        """Let the frame say what these bytes behind it say.

        Raises:
            Exception: whatever bytes from the air do to their reader; the row is then not to be used.
        """
        self.put_note(row, decode(msgpack.unpackb(data), self._agents))

    def pack(self, row: int) -> bytes:
        """The frame as it travels."""
        return self._writer.write(row, self._packed_note(row) if self.frames.loud[row] else b"")

    def unpack(self, row: int, data: bytes) -> None:
        """Let the row be the frame in these bytes, which is whole and of this swarm."""
        parts, frames = parts_of(data), self.frames
        for whole, said in (
            (frames.fixed_bytes, parts.fixed),
            (frames.known_bytes, parts.known),
            (frames.displacement_bytes, parts.displacement),
            (frames.relayed_bytes, parts.relayed),
        ):
            whole[row, : len(said)] = np.frombuffer(said, np.uint8)
        if frames.loud[row]:
            self.read_note(row, parts.note)

    def _packed_note(self, row: int) -> bytes:
        """What a loud frame carries behind its fixed part and whom it knows of."""
        return bytes(msgpack.packb(encode(self._notes[row])))

    def sizes(self, first: int, sent: NDArray[np.bool_]) -> NDArray[np.int64]:
        """(A,) bytes on the wire of the frames in rows first + r where ``sent`` (A,), else 0."""
        rows = slice(first, first + len(sent))
        known = self.frames.known_count[rows].astype(np.int64)
        relayed = RELAYED_BYTES * (self.frames.version[rows] == RELAYING)
        sizes = np.where(sent, FIXED.itemsize + KNOWN_BYTES * known + relayed, 0)
        for row in np.flatnonzero(sent & (self.frames.loud[rows] > 0)).tolist():
            sizes[row] += len(self._packed_note(first + row))
        return sizes
