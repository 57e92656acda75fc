"""What goes between a drone that flies in mixed reality and its world, which is at once its air and part of its room.

    pose      drone -> world, every tick: its record (protocols.wire.beacon), without a frame
    status    drone -> world, when there is news: its account of its slots (protocols.wire.status)
    carried   world -> one drone: the beacons that reach it now, each behind who said it (protocols.wire.heard)
    nature    world -> one drone, ten times a second: what world this is, and the obstacles that the drone sees in it

What a world says to a drone goes on a key of that drone's own: `carried` and `nature` with its number.
"""

import math
import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import msgpack

from protocols.wire.sensed import MAX_OBSTACLES
from protocols.wire.status import AgentStatus, parse_status

VERSION = 1
WORLD = "world"  #: what it is called on the air
Disc = tuple[float, float, float]

_HEAD, _DISC = struct.Struct("<B16s16sfB"), struct.Struct("<fff")
_FARTHEST_M = 1e4
_LONGEST_STATUS, _MOST_ITEMS = 4096, 64


class NatureError(ValueError):
    """Nothing that a drone and its world say to each other."""


class Nature(NamedTuple):
    """fleet, mission: digests (protocols.fleet.plan) of what the world takes part in. sigma_m: of the noise in ``seen``.
    seen: obstacles of the room, centre and radius [m].
    """

    fleet: str
    mission: str
    sigma_m: float
    seen: Sequence[Disc]


def to_drone(what: str, drone: int) -> str:
    """The kind under which a world says ``what`` to one drone."""
    return f"{what}-{drone}"


def pack_nature(nature: Nature) -> bytes:
    """As it travels; of more obstacles than a drone can see, the first."""
    seen = nature.seen[:MAX_OBSTACLES]
    head = _HEAD.pack(VERSION, nature.fleet.encode(), nature.mission.encode(), nature.sigma_m, len(seen))
    return head + b"".join(_DISC.pack(*disc) for disc in seen)


def unpack_nature(data: bytes) -> Nature:
    """Raises NatureError."""
    if len(data) < _HEAD.size or (len(data) - _HEAD.size) % _DISC.size:
        raise NatureError(f"{len(data)} bytes are no news of a world")
    version, fleet, mission, sigma_m, count = _HEAD.unpack_from(data)
    discs = list(_DISC.iter_unpack(data[_HEAD.size :]))
    if version != VERSION or count != len(discs) or count > MAX_OBSTACLES or not 0.0 <= sigma_m <= 1.0:
        raise NatureError("no news of a world of this version")
    if any(not math.hypot(x, y) <= _FARTHEST_M or not 0.0 < radius <= _FARTHEST_M for x, y, radius in discs):
        raise NatureError("an obstacle that cannot be")
    try:
        return Nature(fleet.decode("ascii"), mission.decode("ascii"), sigma_m, discs)
    except UnicodeDecodeError:
        raise NatureError("no news of a world") from None


def pack_status(status: AgentStatus) -> bytes:
    """As it travels."""
    packed: bytes = msgpack.packb(status)
    return packed


def unpack_status(data: bytes, agents: int) -> AgentStatus:
    """Raises NatureError."""
    try:
        if len(data) > _LONGEST_STATUS:
            raise ValueError
        fields: Any = msgpack.unpackb(data, max_array_len=_MOST_ITEMS, max_map_len=0)
        return parse_status(fields, agents)
    except Exception as error:  # whatever these bytes do to their reader
        raise NatureError(f"no account of its slots ({type(error).__name__})") from None
