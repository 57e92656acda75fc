"""Frames on the air as rows, with the slot notes they carry, and as the bytes they travel as.

Drones of one process share the rows instead of packing and unpacking them; the rows hold exactly what the wire would carry.
"""

import numpy as np
from numpy.typing import NDArray

from protocols.slots.notes import SlotNote, decode, encode, quiet_digest, quiet_note
from protocols.wire.frames import FrameCodec, FrameError, empty_frames, swarm_tag

_DIGEST = 2**64 - 1  # as long on the wire as nearly every other


class Air:
    """Rows of frames of one swarm. ``frames`` are the rows, for kernels; a row's note is read and written here.

    A quiet, settled note is no more than the row's ``frames.digest``; only where ``frames.loud`` is there another.
    """

    def __init__(self, swarm: str, agents: int, rows: int) -> None:
        self.frames = empty_frames(rows)
        self._agents = agents
        self._codec = FrameCodec(swarm_tag(swarm), self.frames)
        self._digest, self._loud = self.frames.digest.data, self.frames.loud.data
        self._notes: dict[int, SlotNote] = {}
        self._quiet_bytes = len(self._codec.encode(0, quiet_note(_DIGEST)))

    def note(self, row: int) -> SlotNote:
        """What the frame says about slots."""
        return self._notes[row] if self._loud[row] else SlotNote(self._digest[row], settled=True)

    def put_note(self, row: int, note: SlotNote) -> None:
        """Let the frame say this about slots."""
        self._digest[row], self._loud[row] = note.digest, not (note.quiet and note.settled)
        self._notes[row] = note

    def pack(self, row: int) -> bytes:
        """The frame as it travels."""
        note = encode(self._notes[row]) if self._loud[row] else quiet_note(self._digest[row])
        return self._codec.encode(row, note)

    def unpack(self, data: bytes, row: int) -> int:
        """Write a frame that was heard into ``row``; its sender. The numbers are still to be checked (frames.fault).

        Raises:
            FrameError: it is no frame of this swarm, or cannot be read, whatever the reason; the row is then not to be used.
        """
        try:
            sender, encoded = self._codec.decode(data, row)
            digest = quiet_digest(encoded)
            if digest is not None:
                self._digest[row], self._loud[row] = digest, 0
            else:
                self.put_note(row, decode(encoded, self._agents))
        except FrameError:
            raise
        except (
            Exception
        ) as error:  # whatever bytes from the air do to their reader, they cost no more than one frame
            raise FrameError("malformed") from error
        return sender

    def sizes(self, first: int, sent: NDArray[np.bool_]) -> NDArray[np.int64]:
        """(A,) bytes on the wire of the frames in rows first + r where ``sent`` (A,), else 0."""
        rows = slice(first, first + len(sent))
        known = self.frames.known_count[rows].astype(np.int64)
        # Nine bytes per drone known; msgpack's head for 256 bytes of displacements or more is one byte longer.
        sizes = np.where(sent, self._quiet_bytes + 9 * known + (8 * known > 255), 0)
        for row in np.flatnonzero(sent & (self.frames.loud[rows] > 0)).tolist():
            sizes[row] = len(self.pack(first + row))
        return sizes
