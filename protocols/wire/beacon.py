"""What a drone on the air says 25 times a second to whoever hears it: a short record of itself, and behind it the frame of the
mission (protocols.wire.frames) when there is one.

The record is of the room, the frame of the mission. From the record others know how far away, how alive and how right in time
a drone is, before the mission begins and when it is given up.
"""

import math
import struct
from typing import NamedTuple

from protocols.wire.frames import MAX_FRAME_BYTES

VERSION = 1
NO_TICK = -1
_RECORD = struct.Struct("<BBBBiqffffffHBhBB")
_FARTHEST_M, _FASTEST_MPS = 1e4, 1e3
_OLDEST_MS, _LATEST_MS = 0xFFFF, 0x7FFF
NOBODY = 0xFF
_LATEST = 1 << 62


class BeaconError(ValueError):
    """Nothing that a drone says."""


class Beacon(NamedTuple):
    """sender: its number. phase: index of what it is doing. slot: that it holds. tick: of its mission, `NO_TICK` before.
    utc_us: its time when it said this. p [m], v [m/s]: of the room. age_ms: of that position, at most 65535.
    about, late_ms: how late the beacons of drone ``about`` come to it, by its clock; in turn for all that it hears, `NOBODY`
    if none. battery: per cent. flying: whether it is off the ground.
    """

    sender: int
    phase: int
    slot: int
    tick: int
    utc_us: int
    p: tuple[float, float, float]
    v: tuple[float, float, float]
    age_ms: int
    about: int
    late_ms: int
    battery: int
    flying: bool


def pack_beacon(beacon: Beacon, frame: bytes = b"") -> bytes:
    """As it travels."""
    late_ms = max(-_LATEST_MS, min(beacon.late_ms, _LATEST_MS))
    record = _RECORD.pack(
        VERSION, beacon.sender, beacon.phase, beacon.slot, beacon.tick, beacon.utc_us, *beacon.p, *beacon.v,
        min(beacon.age_ms, _OLDEST_MS), beacon.about, late_ms, beacon.battery, beacon.flying,
    )  # fmt: skip
    return record + frame


def record_of(data: bytes) -> bytes:
    """The record in what a drone said, without the frame."""
    return data[: _RECORD.size]


def unpack_beacon(data: bytes) -> tuple[Beacon, bytes]:
    """A record, and the frame behind it, which is still to be checked; empty: none.

    Raises:
        BeaconError: it cannot be read, or says what cannot be.
    """
    if not _RECORD.size <= len(data) <= _RECORD.size + MAX_FRAME_BYTES:
        raise BeaconError(f"{len(data)} bytes are no beacon")
    version, sender, phase, slot, tick, utc_us, *motion, age_ms, about, late_ms, battery, flying = (
        _RECORD.unpack_from(data)
    )
    if version != VERSION:
        raise BeaconError(f"a beacon of version {version}, not {VERSION}")
    p, v = tuple(motion[:3]), tuple(motion[3:])
    if not (math.hypot(*p) <= _FARTHEST_M and math.hypot(*v) <= _FASTEST_MPS):
        raise BeaconError("a beacon from nowhere")
    if tick < NO_TICK or not 0 <= utc_us < _LATEST or battery > 100 or flying > 1:
        raise BeaconError("a beacon that says what cannot be")
    beacon = Beacon(sender, phase, slot, tick, utc_us, p, v, age_ms, about, late_ms, battery, bool(flying))
    return beacon, data[_RECORD.size :]
