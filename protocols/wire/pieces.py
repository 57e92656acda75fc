"""Long messages travel in pieces: Zenoh's low-latency transport loses what is longer than its link carries at once.

That is 65,535 bytes on a Unix socket and over QUIC. Over TCP and TLS it is the largest multiple of half a segment of TCP below
that, so more than half of it; with the segments of the loopback it is less than 50,000.

What is short and does not begin like a piece travels as it is. Pieces arrive in the order in which they were sent.
"""

from collections.abc import Iterator

LONGEST = 30_000  # bytes of one piece, its mark included; leaves room for Zenoh's own
LONGEST_MESSAGE = 1 << 22  # bytes that are joined: twice what the longest Tick takes
_MORE, _LAST = b"\x01", b"\x00"


def cut(message: bytes) -> Iterator[bytes]:
    """What travels of ``message``, in order."""
    if len(message) <= LONGEST and message[:1] not in (_MORE, _LAST):
        yield message
        return
    step = LONGEST - 1
    for start in range(0, len(message), step):
        piece = message[start : start + step]
        yield (_MORE if start + step < len(message) else _LAST) + piece


class Joiner:
    """The other end: pieces in, messages out. A message that never ends, or is longer than any, is forgotten."""

    def __init__(self, longest: int = LONGEST_MESSAGE) -> None:
        self._longest = longest
        self._joined = bytearray()

    def join(self, piece: bytes) -> bytes | None:
        """The message that ``piece`` completes; None while more is to come."""
        mark = piece[:1]
        if mark not in (_MORE, _LAST):
            self._joined.clear()
            return piece
        self._joined += piece[1:]
        if mark == _MORE:
            if len(self._joined) > self._longest:
                self._joined.clear()
            return None
        message = bytes(self._joined)
        self._joined.clear()
        return message
