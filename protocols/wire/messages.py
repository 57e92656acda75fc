"""What the world and a drone's process say to each other over Zenoh, one msgpack array each, kind first.

drone -> world   HELLO [version]                     asks to take part, repeated until welcomed
                 READY []                            will answer every tick from now on
                 REPLY [tick, ax, ay, slot, frame or nil, status or nil]
world -> drone   WELCOME [mission, initial slots, boot]
                 TICK [tick, sensed (3 byte strings), who sent each frame (1 byte each), frames heard]
                 WAIT []                             nothing new, but the world is alive
                 BYE []                              the flight is over; answered by a last REPLY with a status
"""

from collections.abc import Sequence
from typing import Any

import msgpack

VERSION = 2
HELLO, READY, REPLY, WELCOME, TICK, WAIT, BYE = range(7)
SILENCE_LIMIT_S = 1.5  # a drone's process leaves when the world has said nothing for this long
WAIT_EVERY_S = 0.2  # so the world says at least WAIT this often
MAX_HEARD = 96  # frames one drone can be handed in one tick


class MessageError(ValueError):
    """A message that is not of this protocol."""


def pack(kind: int, *fields: Any) -> bytes:
    """One message."""
    packed: bytes = msgpack.packb((kind, *fields))
    return packed


def unpack(data: bytes) -> tuple[int, Sequence[Any]]:
    """Kind and fields of a message.

    Raises:
        MessageError: not a message.
    """
    try:
        kind, *fields = msgpack.unpackb(data)
    except (ValueError, TypeError, msgpack.exceptions.UnpackException) as error:
        raise MessageError(f"not a message of this protocol ({type(error).__name__})") from error
    if type(kind) is not int or not HELLO <= kind <= BYE:
        raise MessageError(f"unknown kind of message {kind!r}")
    return kind, fields
