"""Frames as they are handed to a drone that hears them: one after the other, each behind its source and its size of 16 bits."""

import struct
from collections.abc import Iterable, Iterator

ENTRY = struct.Struct("<HH")
ENTRY_BYTES = ENTRY.size


def pack_heard(said: Iterable[tuple[int, bytes]]) -> bytes:
    """Each of ``said``: who sent it, as far as the radio knows, and the frame."""
    return b"".join(ENTRY.pack(source, len(frame)) + frame for source, frame in said)


def unpack_heard(data: bytes, count: int) -> Iterator[tuple[int, bytes]]:
    """The first ``count`` of them, or as many as are whole: source and frame."""
    at = 0
    for _ in range(count):
        if at + ENTRY_BYTES > len(data):
            return
        source, size = ENTRY.unpack_from(data, at)
        at += ENTRY_BYTES
        if at + size > len(data):
            return
        yield source, data[at : at + size]
        at += size
