"""An autopilot, as pymavlink sees one: PX4 or ArduPilot (Copter), by their documentation and their sources.

PX4: OFFBOARD is entered, and armed in, only after setpoints have come at more than 2 Hz for a second. When they stop for
COM_OF_LOSS_T, it does what COM_OBL_RC_ACT says: 4 is a landing; by default it waits for a pilot, who is not there. It leaves the
ground when a setpoint is above where it takes itself to be; as that wanders, one at its own height lifts it off.

ArduPilot: armed in GUIDED only; leaves the ground only by NAV_TAKEOFF. Without setpoints for GUID_TIMEOUT it stops at the last
position it was told. Without heartbeats of its ground station for FS_GCS_TIMEOUT it lands where FS_GCS_ENABLE is 5, after it has
held for 4 s. It follows late, and sinks, stands and swings as the firmware of ArduCopter 4.7-dev did (docs/hardware.md).

Where it has its origin from satellites, ArduPilot keeps that and says nothing to another, or takes it after it has
said that it took another; PX4 takes what it is given.

Both follow late, and sink, stand and swing as the firmware of ArduCopter 4.7-dev and of PX4 1.14 did (docs/hardware.md). A
landing ends disarmed; armed on the ground for 10 s, they disarm; in the air they are disarmed by force alone.
"""

import math
import struct
from dataclasses import replace
from enum import Enum
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.fakes.motion import STILL, Goal, Lag, Motion, Vector

_STEP_S = 0.005
_CLIMB_MPS = 1.0
_FORCE = 21196
_WANDERS_M = 0.3  # its height by its own estimate
_DRAIN_PER_S = 1 / 900
STREAM_FOR_S, STREAM_GAP_S, IDLE_DISARM_S = 1.0, 0.5, 10.0


class Make(Enum):
    """Whose autopilot: its number in a heartbeat, the custom modes of being led, landing and waiting for a pilot; how fast it
    sinks [m/s], how long its failsafe waits before that, and how long it stands before its motors are off [s]; its lag."""

    PX4 = (12, 6 << 16, 4 << 16 | 6 << 24, 3 << 16), (0.4, 0.0, 2.0), Lag(1.7, 1.8, 0.15)
    ARDUPILOT = (3, 4, 9, 5), (0.5, 4.0, 2.0), Lag(2.0, 2.0, 0.3)

    def __init__(
        self, numbers: tuple[int, int, int, int], landing: tuple[float, float, float], lag: Lag
    ) -> None:
        self.number, self.led, self.land, self.wait = numbers
        self.sink_mps, self.pause_s, self.stand_s = landing
        self.lag = lag


def ned(enu: Vector) -> Vector:
    return enu[1], enu[0], -enu[2]


class FakeAutopilot:
    """As tests.fakes.udp.Fake has it; its place is in the room: x east, y north, z up.

    Attributes that a test may set:
        frozen: it has no position any more, and says nothing of it. dead_link: nothing comes through. battery: 0 to 1.
        needs_position: it knows where it is only while it is told. parameters: its own. origin: latitude, longitude, altitude as
        MAVLink has them, or None. lies: where that is in the room, which is where it counts from. higher: by how much more its
        satellites say that the floor is than the origin that it is given [m]. guesses: its estimator does not know where it is.
        fails: what one of its own checks says, or empty; PX4 says so only to a ground station.
    Attributes to look at:
        motion, custom_mode, armed; targets: how many setpoints it was sent; fell: in m/s.
    """

    def __init__(self, make: Make, start: Vector = STILL, system: int = 1, tuned: bool = True) -> None:
        """``tuned``: its parameters are as they should be, not as they come."""
        self.make, self.motion = make, Motion(start, lag=make.lag)
        self.custom_mode, self.armed = make.wait, False
        self.frozen = self.dead_link = self.needs_position = self.guesses = False
        self.fails = ""
        self.battery, self.targets = 1.0, 0
        self.origin: tuple[int, int, int] | None = None
        self.lies: Vector = STILL
        self.higher = 0.0
        px4 = {"COM_OF_LOSS_T": 0.5 if tuned else 1.0, "COM_OBL_RC_ACT": 4.0 if tuned else 0.0}
        ardupilot = {
            "GUID_TIMEOUT": 0.5 if tuned else 3.0,
            "FS_GCS_ENABLE": 5.0 if tuned else 0.0,
            "FS_GCS_TIMEOUT": 2.0 if tuned else 5.0,
        }
        self.parameters = px4 if make is Make.PX4 else ardupilot
        self._mav = mavlink.MAVLink(None, srcSystem=system, srcComponent=1)
        self._mav.robust_parsing = True
        self._now = 0.0
        self._goal: Goal | None = None
        self._target_at = self._streaming_since = self._station_at = self._armed_at = (
            self._measured_at
        ) = -math.inf
        self._climbing_to: float | None = None
        self._sinks_at = -math.inf
        message_ids = {"HEARTBEAT": 1.0, "LOCAL_POSITION_NED": 0.1, "ATTITUDE": 0.1, "SYS_STATUS": 1.0}
        self._due = {name: [period, 0.0] for name, period in message_ids.items()}

    @property
    def fell(self) -> float:
        return self.motion.fell

    @property
    def landed(self) -> bool:
        return self.motion.p[2] <= 0.0

    # Time

    def advance(self, dt: float) -> list[bytes]:
        said: list[bytes] = []
        until = self._now + dt
        while self._now < until - 1e-9:
            step = min(_STEP_S, until - self._now)
            self._now += step
            self._watch()
            self._step(step)
            said += self._telemetry()
        return [] if self.dead_link else said

    def _watch(self) -> None:
        silent = self._now - self._target_at
        if not self.armed:
            return
        if self.make is Make.PX4 and self.custom_mode == self.make.led:
            if silent > self.parameters["COM_OF_LOSS_T"]:
                self.custom_mode = (
                    self.make.land if self.parameters["COM_OBL_RC_ACT"] == 4 else self.make.wait
                )
        elif self.make is Make.ARDUPILOT and self.custom_mode == self.make.led:
            if silent > self.parameters["GUID_TIMEOUT"] and self._goal:
                self._goal = Goal(self._goal.p, yaw=self._goal.yaw)
            if (
                self.parameters["FS_GCS_ENABLE"] == 5
                and self._station_at > -math.inf  # it misses nobody whom it never heard
                and self._now - self._station_at > self.parameters["FS_GCS_TIMEOUT"]
            ):
                self.custom_mode, self._sinks_at = self.make.land, self._now + self.make.pause_s
        patience = self.make.stand_s if self.custom_mode == self.make.land else IDLE_DISARM_S
        if self.landed and self._now - self._armed_at > patience:
            self.armed, self._goal, self._climbing_to = False, None, None

    def _step(self, dt: float) -> None:
        goal = self._wanted()
        if not self.armed or goal is None:
            self.motion.drop(dt)
            return
        self.battery = max(0.0, self.battery - _DRAIN_PER_S * dt)
        self.motion.fly(goal, dt)
        if not self.landed:
            self._armed_at = self._now

    def _wanted(self) -> Goal | None:
        x, y, z = self.motion.p
        if self.custom_mode == self.make.land:
            sinks = self._now >= self._sinks_at
            return Goal(
                (x, y, None if sinks else z), (0.0, 0.0, -self.make.sink_mps * sinks), yaw=self.motion.yaw
            )
        if self.custom_mode != self.make.led:
            return None if self.landed else Goal((None, None, z))  # a pilot whose hands are off: it drifts
        if self._climbing_to is not None:
            if z >= self._climbing_to - 0.05:
                self._climbing_to, self._goal = None, Goal((x, y, self._climbing_to))
            else:
                return Goal((x, y, None), (0.0, 0.0, _CLIMB_MPS), yaw=self.motion.yaw)
        if self._goal is None:
            return None
        low = self._goal.p[2] or 0.0
        if self.make is Make.PX4 and abs(low) < _WANDERS_M:
            return replace(self._goal, p=(*self._goal.p[:2], _WANDERS_M))
        return None if self.landed and low < 0.02 else self._goal

    # What it is sent

    def take(self, datagram: bytes) -> list[bytes]:
        if self.dead_link:
            return []
        said: list[Any] = []
        for message in self._mav.parse_buffer(datagram) or []:
            answer = getattr(self, f"_on_{message.get_type().lower()}", None)
            if answer and getattr(message, "target_system", self._mav.srcSystem) in (0, self._mav.srcSystem):
                said += answer(message)
        return [message.pack(self._mav) for message in said]

    def _on_heartbeat(self, message: Any) -> list[Any]:
        if message.get_srcSystem() == 255:
            self._station_at = self._now
        return []

    def _on_set_position_target_local_ned(self, message: Any) -> list[Any]:
        if message.coordinate_frame != mavlink.MAV_FRAME_LOCAL_NED:
            return []
        if self._now - self._target_at > STREAM_GAP_S:
            self._streaming_since = self._now
        self._target_at = self._now
        self.targets += 1
        if self.make is Make.ARDUPILOT and (self.landed or self.custom_mode != self.make.led):
            return []
        numbers = [(message.x, message.y, message.z), (message.vx, message.vy, message.vz)]
        numbers.append((message.afx, message.afy, message.afz))
        used = [(message.type_mask >> shift) & 7 == 0 for shift in (0, 3, 6)]
        p, v, a = (ned(vector) if use else STILL for vector, use in zip(numbers, used, strict=True))
        p = p[0] + self.lies[0], p[1] + self.lies[1], p[2] + self.lies[2]
        yaw = self.motion.yaw if message.type_mask & 1024 else math.pi / 2 - message.yaw
        self._goal, self._climbing_to = Goal(p, v, a, yaw), None
        return []

    def _on_command_long(self, message: Any) -> list[Any]:
        what = {
            mavlink.MAV_CMD_DO_SET_MODE: self._set_mode,
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_or_disarm,
            mavlink.MAV_CMD_NAV_TAKEOFF: self._take_off,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_RUN_PREARM_CHECKS: lambda _: mavlink.MAV_RESULT_ACCEPTED,
        }.get(message.command)
        if message.command == mavlink.MAV_CMD_REQUEST_MESSAGE:
            return self._its_origin() if message.param1 == 49 else []
        result = what(message) if what else mavlink.MAV_RESULT_UNSUPPORTED
        ack = mavlink.MAVLink_command_ack_message(message.command, result)
        if (
            self.fails
            and self.make is Make.ARDUPILOT
            and message.command == mavlink.MAV_CMD_RUN_PREARM_CHECKS
        ):
            return [mavlink.MAVLink_statustext_message(2, f"PreArm: {self.fails}".encode()), ack]
        return [ack]

    def _set_mode(self, message: Any) -> int:
        mode = (
            int(message.param2) << 16 | int(message.param3) << 24
            if self.make is Make.PX4
            else int(message.param2)
        )
        if mode == self.make.led and not (self._streams and self._located):
            return int(mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
        self.custom_mode = mode
        return int(mavlink.MAV_RESULT_ACCEPTED)

    @property
    def _streams(self) -> bool:
        """Whether setpoints have come for long enough, as only PX4 wants to know."""
        fresh = self._now - self._target_at < STREAM_GAP_S
        return self.make is Make.ARDUPILOT or (fresh and self._now - self._streaming_since >= STREAM_FOR_S)

    @property
    def _located(self) -> bool:
        return not self.frozen and (not self.needs_position or self._now - self._measured_at < 0.5)

    def _arm_or_disarm(self, message: Any) -> int:
        if not message.param1:
            if not self.landed and message.param2 != _FORCE:
                return int(mavlink.MAV_RESULT_DENIED)
            self.armed, self._goal = False, None
            return int(mavlink.MAV_RESULT_ACCEPTED)
        if not (
            self.custom_mode == self.make.led
            and self._streams
            and self._located
            and self.battery > 0.15
            and not (self.guesses or self.fails)
        ):
            return int(mavlink.MAV_RESULT_DENIED)
        self.armed, self._armed_at = True, self._now
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _take_off(self, message: Any) -> int:
        if self.make is Make.PX4 or not (self.armed and self.landed and self.custom_mode == self.make.led):
            return int(mavlink.MAV_RESULT_DENIED)
        self._climbing_to = message.param7
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _set_interval(self, message: Any) -> int:
        name = mavlink.mavlink_map[int(message.param1)].msgname
        self._due[name] = [message.param2 / 1e6, self._now]
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _on_param_request_read(self, message: Any) -> list[Any]:
        name = message.param_id.strip("\0")
        if name not in self.parameters:
            return []
        value, kind = self.parameters[name], mavlink.MAV_PARAM_TYPE_REAL32
        if name in ("COM_OBL_RC_ACT", "FS_GCS_ENABLE"):
            kind = mavlink.MAV_PARAM_TYPE_INT32
            if self.make is Make.PX4:  # PX4 sends the bytes of an integer, ArduPilot its value
                (value,) = struct.unpack("<f", struct.pack("<i", int(value)))
        return [mavlink.MAVLink_param_value_message(name.encode(), value, kind, len(self.parameters), 0)]

    def _on_set_gps_global_origin(self, message: Any) -> list[Any]:
        if self.origin and self.make is Make.ARDUPILOT:
            return []
        self.origin = message.latitude, message.longitude, message.altitude
        self.lies = 0.0, 0.0, -self.higher
        return self._its_origin()

    def _its_origin(self) -> list[Any]:
        return [mavlink.MAVLink_gps_global_origin_message(*self.origin)] if self.origin else []

    def _on_vision_position_estimate(self, message: Any) -> list[Any]:
        self._measured_at = self._now
        return []

    _on_odometry = _on_att_pos_mocap = _on_vision_position_estimate

    # What it says of itself

    def _telemetry(self) -> list[bytes]:
        said = []
        for name, timer in self._due.items():
            if self._now >= timer[1] and (message := self._message(name)):
                timer[1] = max(timer[1] + timer[0], self._now - timer[0])
                said.append(message.pack(self._mav))
        return said

    def _message(self, name: str) -> Any:
        ms, motion = round(1000 * self._now), self.motion
        if name == "HEARTBEAT":
            base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | 128 * self.armed
            return mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_QUADROTOR,
                self.make.number,
                base,
                self.custom_mode,
                4 if self.armed else 3,
                3,
            )
        if name == "LOCAL_POSITION_NED" and self._located:
            x, y, z = (at - zero for at, zero in zip(motion.p, self.lies, strict=True))
            return mavlink.MAVLink_local_position_ned_message(ms, *ned((x, y, z)), *ned(motion.v))
        if name == "ATTITUDE":
            roll, pitch, yaw = motion.tilt
            return mavlink.MAVLink_attitude_message(ms, roll, -pitch, math.pi / 2 - yaw, 0.0, 0.0, 0.0)
        if name == "SYS_STATUS":
            percent = round(100 * self.battery)
            checks = mavlink.MAV_SYS_STATUS_PREARM_CHECK if self.make is Make.ARDUPILOT else 0
            healthy = checks if not self.fails else 0
            return mavlink.MAVLink_sys_status_message(
                checks, checks, healthy, 100, 12000, 100, percent, 0, 0, 0, 0, 0, 0
            )
        flags = 0b10100100 if self.guesses else 0b1100111111  # as both firmwares said it
        if name == "ESTIMATOR_STATUS" and self.make is Make.PX4:
            return mavlink.MAVLink_estimator_status_message(ms, flags, *(0.0,) * 8)
        if name == "EKF_STATUS_REPORT" and self.make is Make.ARDUPILOT:
            return mavlink.MAVLink_ekf_status_report_message(flags, *(0.0,) * 5)
        if name == "GPS_GLOBAL_ORIGIN" and self.origin:
            return mavlink.MAVLink_gps_global_origin_message(*self.origin)
        if name == "EXTENDED_SYS_STATE":
            return mavlink.MAVLink_extended_sys_state_message(0, 1 if self.landed else 2)
        return None
