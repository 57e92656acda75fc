"""Long messages travel in pieces: Zenoh's low-latency transport loses what is longer than its link carries at once, and a
datagram carries what fits into a packet.

Zenoh's limit is 65,535 bytes on a Unix socket and over QUIC. Over TCP and TLS it is the largest multiple of half a segment of TCP
below that, so more than half of it; with the segments of the loopback it is less than 50,000.

What is short and does not begin like a piece travels as it is. Pieces may get lost, or arrive out of order: each says of which
message it is, and a message of which one is missing is never made up from others.
"""

import struct
from collections.abc import Iterator

LONGEST = 30_000  # bytes of one piece, its head included; leaves room for Zenoh's own
LONGEST_MESSAGE = 1 << 22  # bytes that are joined: twice what the longest Tick takes
_MARK = 0
_HEAD = struct.Struct("<BIHH")  # mark, number of the message, which piece of it, of how many
_NUMBERS = 2**32
_OPEN = 4  # messages of which some pieces have come; older ones are given up


def is_whole(piece: bytes) -> bool:
    """Whether this is a message as it is."""
    return piece[:1] > b"\x00"


def cut(message: bytes, number: int, longest: int = LONGEST) -> Iterator[bytes]:
    """What travels of ``message``, in order; ``number`` it differs from that of all lately."""
    if len(message) <= longest and is_whole(message):
        yield message
        return
    step = longest - _HEAD.size
    count = max(1, -(-len(message) // step))
    for index in range(count):
        head = _HEAD.pack(_MARK, number % _NUMBERS, index, count)
        yield head + message[index * step : (index + 1) * step]


class Joiner:
    """The other end: pieces in, messages out. A message that never ends, or is longer than any, is forgotten."""

    def __init__(self, longest: int = LONGEST_MESSAGE) -> None:
        self._longest = longest
        self._open: dict[tuple[int, int], dict[int, bytes]] = {}  # by number and count
        self._bytes = 0

    def join(self, piece: bytes) -> bytes | None:
        """The message that ``piece`` completes; None while more is to come, and of what is no piece."""
        if is_whole(piece):
            return piece
        if len(piece) < _HEAD.size:
            return None
        _, number, index, count = _HEAD.unpack_from(piece)
        parts = self._open.setdefault((number, count), {})
        if index < count and index not in parts:
            parts[index] = piece[_HEAD.size :]
            self._bytes += len(piece)
        if len(parts) == count:
            self._forget((number, count))
            return b"".join(parts[place] for place in range(count))
        while len(self._open) > _OPEN or self._bytes > self._longest:
            self._forget(next(iter(self._open)))
        return None

    def _forget(self, message: tuple[int, int]) -> None:
        self._bytes -= sum(_HEAD.size + len(part) for part in self._open.pop(message).values())
