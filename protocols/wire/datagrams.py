"""Datagrams between a drone and the world, beside the link that loses nothing: for what is worth nothing when it comes late.

A datagram is the drone's number, the datagram's number, and a piece of a message, sealed (ChaCha20-Poly1305, RFC 8439) with a key
that the world has made for this process of the drone alone and told it in its Welcome. Its number and direction are the seal's
nonce: nobody else can make one, read one, or pass off an old one as new.

    1 byte   the drone
    8 bytes  number, little endian; each end counts its own from 1
    rest     the sealed piece
"""

import secrets
import struct
import sys
from collections.abc import Iterator

from protocols.wire.endpoints import is_port, split
from protocols.wire.pieces import Joiner, cut

KEY_BYTES = 32
LONGEST = 1200  # bytes of a piece: what every network carries in one packet
SIZE = 2048  # no datagram is longer
_HEAD = struct.Struct("<BQ")
_LATE = 64  # a datagram that is so many numbers late is not taken
_TO_WORLD, _TO_DRONE = b"\x00" * 4, b"\x01" * 4


def share_time() -> None:
    """From now on no thread of this process has the interpreter for longer than 0.2 ms at a stretch, where it would be 5 ms.

    Anybody may send rubbish to a UDP port. Whoever hears it is then as busy as can be, and the thread that flies would wait
    5 ms each time that it has waited for something.
    """
    sys.setswitchinterval(2e-4)


def fresh_key() -> bytes:
    """A key for one process of one drone."""
    return secrets.token_bytes(KEY_BYTES)


def place_of(endpoint: str) -> tuple[str, int] | None:
    """Host and UDP port for the datagrams of a world that listens on ``endpoint``; None for a socket of this machine.

    It is the same number as the endpoint's, and the next one (after the last the one before) where that is taken: QUIC is UDP
    itself.
    """
    protocol, host, port = split(endpoint)
    if protocol == "unixsock-stream":
        return None
    beside = port + 1 if is_port(port + 1) else port - 1
    return host, beside if protocol == "quic" else port


class Seal:
    """One end of the datagrams of one process of drone ``agent``; ``at_world``: the world's end."""

    def __init__(self, key: bytes, agent: int, at_world: bool) -> None:
        # Only who flies in real time over a network needs it, and it is large.
        from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305

        self._cipher, self._agent = ChaCha20Poly1305(key), agent
        self._ours, self._theirs = (_TO_DRONE, _TO_WORLD) if at_world else (_TO_WORLD, _TO_DRONE)
        self._sent = self._newest = self._seen = 0
        self._joiner = Joiner()

    def wrap(self, message: bytes) -> Iterator[bytes]:
        """The datagrams that carry ``message``."""
        for piece in cut(message, self._sent + 1, LONGEST):
            self._sent += 1
            head = _HEAD.pack(self._agent, self._sent)
            yield head + self._cipher.encrypt(self._ours + head[1:], piece, head)

    def unwrap(self, datagram: bytes) -> tuple[bool, bytes | None]:
        """Whether this is a datagram of the other end that has not been seen, and the message that it completes, if any."""
        from cryptography.exceptions import InvalidTag

        if len(datagram) <= _HEAD.size:
            return False, None
        head = datagram[: _HEAD.size]
        _, number = _HEAD.unpack(head)
        late = self._newest - number
        if late >= _LATE or (late >= 0 and self._seen >> late & 1):
            return False, None
        try:
            piece = self._cipher.decrypt(self._theirs + head[1:], datagram[_HEAD.size :], head)
        except InvalidTag:
            return False, None
        if late < 0:
            self._seen = ((self._seen << -late) | 1) & ((1 << _LATE) - 1) if -late < _LATE else 1
            self._newest = number
        else:
            self._seen |= 1 << late
        return True, self._joiner.join(piece)


def sender_of(datagram: bytes) -> int:
    """The drone that a datagram names; -1 if it is none."""
    return datagram[0] if _HEAD.size < len(datagram) <= SIZE else -1
