"""What an autopilot has said of itself, put together from its MAVLink messages; in the frame of the room."""

import math
import struct
from typing import Any

from agent.air.autopilots import PROFILES, Profile
from agent.air.vehicle import Vector, VehicleError
from protocols.fleet.place import Flat, ned_of, ned_yaw, way
from protocols.keeper import Seen

_AUTOPILOT, _NO_AUTOPILOT = 1, 8  # component; MAV_AUTOPILOT_INVALID
_ARMED, _UNKNOWN_STATE, _ON_GROUND, _ARM_DISARM, _WARNING = 128, 0, 1, 400, 4
_STATION = 6  # MAV_TYPE_GCS
_INTEGERS = (1, 2, 3, 4, 5, 6)  # MAV_PARAM_TYPE
# What its estimator knows: velocity and position along the ground, the latter by either; or it takes it that it stands still.
_MOVES, _PLACED, _GUESSES = 2, 8 | 16, 128
_PASSES = 1 << 28  # MAV_SYS_STATUS_PREARM_CHECK
_UNSURE_S = 0.5  # a word that is taken back at once is none
UNKNOWN = math.nan


class Telemetry:
    """Takes messages of pymavlink.

    Attributes:
        system: its number; 0 before the first heartbeat. profile: which autopilot it is; None before that.
        custom_mode, armed, flying: as its heartbeats and its own judgment of the ground have it.
        p, v [m, m/s], yaw, tilt [rad]: newest. measured_at [s]: when p came; an old one that is said again does not count,
        nor one that its estimator does not vouch for. said_at [s]: when any p came.
        battery: 0 to 1, or `UNKNOWN`. parameters: those that it was asked for. refusal: why it is not armed, in words, or empty.
        unready: whether its own checks do not pass. check: what one of them says, or empty.
        lies: where the origin of its own frame lies in the room [m], east and north; None: not known yet. floor: how high it says
        that the ground is on which it stood last [m]: satellites are metres off in height, and drift. others: numbers of the
        other autopilots on this link. stations: when a ground station of each number was heard last [s].
    """

    def __init__(self, system: int, asked: Profile | None, start: Vector, room: Flat | None = None) -> None:
        """``system``, ``asked``: which one it has to be; 0 and None: whoever is heard first. ``room``: latitude and longitude of
        the room's origin [degrees]; None: its own origin is the room's."""
        self.system, self._asked = system, asked
        self.profile: Profile | None = None
        self.custom_mode, self.armed, self.flying = -1, False, False
        self.p, self.v = start, (0.0, 0.0, 0.0)
        self.yaw = self.tilt = 0.0
        self.measured_at = self.said_at = -math.inf
        self._boot_ms, self._unsure_since = -1, math.inf
        self.battery = UNKNOWN
        self.parameters: dict[str, float] = {}
        self.refusal = self.check = ""
        self.unready = False
        self._room = room
        self.lies: Flat | None = None if room else (0.0, 0.0)
        self.floor, self._landed = 0.0, True
        self.others: set[int] = set()
        self.stations: dict[int, float] = {}

    def seen(self, now: float) -> Seen:
        """As a keeper wants it."""
        return Seen(
            now, self.p, self.v, self.yaw, self.tilt, self.battery, self.armed, False, self.flying, False
        )

    def sure(self, now: float) -> bool:
        """Whether its estimator knows where it is; one that says nothing of that is believed."""
        return now - self._unsure_since < _UNSURE_S

    def unknown(self) -> list[str]:
        """Names of the parameters that it has not told yet."""
        wanted = self.profile.wanted if self.profile else ()
        return [one.name for one in wanted if one.name not in self.parameters]

    def take(self, message: Any, now: float) -> None:
        """A message came.

        Raises:
            VehicleError: it is of another autopilot than was asked for.
        """
        kind = message.get_type()
        if kind == "HEARTBEAT":
            self._take_heartbeat(message, now)
        elif message.get_srcSystem() != self.system or self.profile is None:
            return
        elif kind == "LOCAL_POSITION_NED":
            self._take_position(message, now)
        elif kind == "ATTITUDE" and all(map(math.isfinite, (message.roll, message.pitch, message.yaw))):
            self.yaw = ned_yaw(message.yaw)
            self.tilt = math.acos(max(-1.0, min(1.0, math.cos(message.roll) * math.cos(message.pitch))))
        elif kind == "SYS_STATUS":
            percent = message.battery_remaining
            self.battery = percent / 100 if 0 <= percent <= 100 else UNKNOWN
            failing = message.onboard_control_sensors_enabled & ~message.onboard_control_sensors_health
            self.unready = bool(failing & _PASSES)
            self.check = self.check if self.unready else ""
        elif kind in ("ESTIMATOR_STATUS", "EKF_STATUS_REPORT"):
            sure = message.flags & _MOVES and message.flags & _PLACED and not message.flags & _GUESSES
            self._unsure_since = math.inf if sure else min(self._unsure_since, now)
        elif kind == "EXTENDED_SYS_STATE":
            self._landed = message.landed_state in (_UNKNOWN_STATE, _ON_GROUND)
            self.flying = self.armed and message.landed_state != _ON_GROUND
        elif kind == "PARAM_VALUE":
            self.parameters[message.param_id] = _value(message, self.profile)
        elif kind == "GPS_GLOBAL_ORIGIN":
            if self._room:
                self.lies = way(self._room, (message.latitude / 1e7, message.longitude / 1e7))
        elif kind == "COMMAND_ACK" and message.command == _ARM_DISARM:
            self.refusal = "" if message.result == 0 else self.refusal or "it refuses to be armed"
        elif kind == "STATUSTEXT" and message.severity <= _WARNING:
            text = " ".join(message.text.split())
            self.check = text if self.unready else self.check
            self.refusal = self.refusal and f"it refuses to be armed: {text}"

    def _take_heartbeat(self, message: Any, now: float) -> None:
        if message.type == _STATION:
            self.stations[message.get_srcSystem()] = now
        if message.get_srcComponent() != _AUTOPILOT or message.autopilot == _NO_AUTOPILOT:
            return
        if self.profile is None and self.system in (0, message.get_srcSystem()):
            found = next((one for one in PROFILES.values() if one.number == message.autopilot), None)
            if found is None:
                return
            if self._asked not in (None, found):
                raise VehicleError(
                    f"the autopilot there is {found.name}: write ?autopilot={found.name}, or nothing"
                )
            self.system, self.profile = message.get_srcSystem(), found
        if self.profile is not None and message.get_srcSystem() == self.system:
            self.custom_mode, self.armed = message.custom_mode, bool(message.base_mode & _ARMED)
            self.flying = self.flying and self.armed
        elif self.profile is not None:
            self.others.add(message.get_srcSystem())

    def _take_position(self, message: Any, now: float) -> None:
        if self.lies is None:
            return
        p, v = (message.x, message.y, message.z), (message.vx, message.vy, message.vz)
        if message.time_boot_ms != self._boot_ms and all(map(math.isfinite, (*p, *v))):
            (x, y, z), (east, north) = ned_of(p), self.lies
            if self._room and self._landed and not self.armed:
                self.floor = z
            self.p, self.v = (x + east, y + north, z - self.floor), ned_of(v)
            self._boot_ms, self.said_at = message.time_boot_ms, now
            self.measured_at = now if self.sure(now) else self.measured_at


def _value(message: Any, profile: Profile) -> float:
    """Of a parameter."""
    if profile.integers_as_bytes and message.param_type in _INTEGERS:
        return float(struct.unpack("<i", struct.pack("<f", message.param_value))[0])
    return float(message.param_value)
