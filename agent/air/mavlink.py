"""``mavlink:CONNECTION``, an autopilot that speaks MAVLink: PX4 or ArduPilot, by UDP, TCP or a serial line (extra ``mavlink``).

CONNECTION is ``udpin:HOST:PORT`` (it calls us), ``udpout:HOST:PORT``, ``tcp:HOST:PORT`` or ``serial:DEVICE:BAUD``, and behind a
``?`` perhaps ``autopilot=px4`` or ``autopilot=ardupilot`` (else as its heartbeat says) and ``system=NUMBER`` (else the first that
is heard), with ``&`` between.

The option ``origin`` of its drone in the fleet file is ``LATITUDE,LONGITUDE,ALTITUDE`` of the room's origin, for who knows where
it is by satellites: one that has no origin yet takes this one, and one that has its own keeps that, and is led from there.
Heights count from the ground on which it stands before it is armed. Without that option its own local frame is the room's, as
with motion capture.

Nobody on the way is asked who they are: MAVLink belongs on a wire, or on an address of the own machine.
"""

import errno
import importlib
import math
import os
import re
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, NamedTuple
from urllib.parse import parse_qsl

from agent.air.autopilots import PROFILES, Climb, Leader, Profile, Say, SetArmed, SetMode
from agent.air.orders import Ordered
from agent.air.telemetry import UNKNOWN, Telemetry
from agent.air.vehicle import Mode, Rig, Setpoint, State, VehicleAddressError, VehicleError
from protocols.fleet.place import ned_of, ned_yaw
from protocols.keeper import Stream
from protocols.wire.endpoints import is_port
from protocols.wire.vehicles import Kind, Order

_CONNECTION = re.compile(r"(udpin|udpout|tcp):[^:/?\s]+:\d{1,5}|serial:/[^:?\s]+:\d{1,8}", re.ASCII)
_SYSTEM, _COMPONENT = 255, 191  # a ground station's number: ArduPilot's failsafe counts its heartbeats
_STATION_S = 5.0  # a ground station speaks once a second
_HEARTBEAT_S, _CALL_S, _ASK_AGAIN_S, _CHECK_S, _SOON_S, _WAIT_S = 1.0, 0.1, 0.5, 3.0, 0.015, 0.005
_ASKED_TIMES = 3  # one may be lost
_MOST_MESSAGES = 500  # read at one look
# Messages by their numbers, and how often they are wanted: heartbeat, status, attitude, local position, extended state.
_STREAMS_HZ = {0: 5, 1: 2, 30: 25, 32: 50, 245: 5}
_IGNORE_YAW_RATE, _LOCAL_NED = 2048, 1
_SET_MODE, _ARM_DISARM, _TAKE_OFF, _CHECK, _SET_INTERVAL, _SAY = 176, 400, 22, 401, 511, 512  # MAV_CMD
_ESTIMATE_HZ = 5
_ORIGIN = 49  # number of a message
_FARTHEST_M = 1000.0  # between its origin and the room's
_FORCE = 21196
_DIALECT = "ardupilotmega"
_WHY_NOT = {
    errno.EACCES: "this user may not; add it to the group that may, often dialout",
    errno.EAGAIN: "another program uses it",
    errno.ENOENT: "there is no such device",
    errno.EADDRINUSE: "another program listens there",
    errno.EADDRNOTAVAIL: "that is no address of this machine",
    errno.ECONNREFUSED: "nobody listens there",
}


class Address(NamedTuple):
    """As above. system: 0: the first that is heard."""

    connection: str
    autopilot: Profile | None
    system: int


class MavlinkVehicle(Ordered):
    """As agent.air.vehicle.Vehicle has it."""

    lags = True  # an autopilot shapes what it is told: half a second passes until it moves as fast

    def __init__(
        self,
        where: str,
        rig: Rig,
        connect: Callable[[str], Any] | None = None,
        now: Callable[[], float] = time.monotonic,
        wait: Callable[[float], None] = time.sleep,
    ) -> None:
        """``connect``: makes what pymavlink calls a connection; ``now``, ``wait``: its time.

        Raises:
            VehicleAddressError: ``where`` is no such connection, or an option is wrong.
        """
        self._name, self._rig = f"mavlink:{where}", rig
        self._connect, self._now, self._wait = connect or connected, now, wait
        try:
            self._address, self._origin = parse_address(where), parse_origin(rig.options)
        except ValueError as error:
            raise VehicleAddressError(f"{self._name}: {error}") from None
        self._link: Any = None
        room = self._origin and (self._origin[0] / 1e7, self._origin[1] / 1e7)
        self._heard = Telemetry(self._address.system, self._address.autopilot, rig.start, room)
        self._leader: Leader | None = None
        self._heartbeat_at = self._called_at = self._asked_at = self._checked_at = self._fly_at = -math.inf
        self._asked_streams = 0

    # The port

    def open(self, timeout_s: float) -> None:
        deadline = self._now() + timeout_s
        self._link = self._connect(self._address.connection)
        while not (self._leader and self._now() - self._heard.said_at < 1.0 and not self._heard.unknown()):
            if self._now() > deadline:
                self.close()
                raise VehicleError(f"{self._name}: {self._what_is_missing()} within {timeout_s:g} s")
            self._look()
            self._wait(_WAIT_S)

    def state(self) -> State:
        self._look()
        leader, heard = self._led(), self._heard
        if self._order.kind is not Kind.FLY:  # who says a setpoint again hangs
            leader.keeper.hear(self._order, self._now())
        self._lead()
        return State(
            p=heard.p,
            v=heard.v,
            yaw=heard.yaw,
            tilt=heard.tilt,
            age_s=self._now() - heard.measured_at,
            battery=0.0 if math.isnan(heard.battery) else heard.battery,
            # Led by somebody else it does not do as it is told: as one that lands.
            mode=Mode.LAND if leader.taken else leader.keeper.mode,
            armed=leader.keeper.armed and heard.armed,
            health=tuple(self._ills(leader)),
        )

    def fly(self, setpoint: Setpoint) -> None:
        if self._now() - self._fly_at >= _SOON_S:
            self._fly_at = self._now()
            self._give(self._next(Kind.FLY, *setpoint))

    def close(self) -> None:
        if self._link is not None:
            with suppress(OSError):
                self._link.close()
            self._link = None

    # What is said

    def _give(self, order: Order) -> None:
        self._order = order
        self._led().keeper.hear(order, self._now())
        self._lead()

    def _led(self) -> Leader:
        if self._leader is None or self._link is None:
            raise VehicleError(f"{self._name} is not open")
        return self._leader

    def _lead(self) -> None:
        now = self._now()
        for one in self._led().say(self._heard.seen(now), self._heard.custom_mode, now):
            self._say(one)

    def _say(self, one: Say) -> None:
        match one:
            case Stream((x, y, z), v, a, yaw):
                east, north = self._heard.lies or (0.0, 0.0)
                place = x - east, y - north, z + self._heard.floor
                target = (*ned_of(place), *ned_of(v), *ned_of(a), ned_yaw(yaw), 0.0)
                ms = round(1000 * self._now()) & 0xFFFFFFFF
                self._link.mav.set_position_target_local_ned_send(
                    ms, self._heard.system, 1, _LOCAL_NED, _IGNORE_YAW_RATE, *target
                )
            case SetMode(mode):
                self._command(_SET_MODE, 1, *self._led().profile.mode_numbers(mode))
            case SetArmed(on, force):
                self._command(_ARM_DISARM, int(on), _FORCE if force else 0)
            case Climb(height):
                self._command(_TAKE_OFF, 0, 0, 0, math.nan, 0, 0, height)

    def _command(self, command: int, *values: float) -> None:
        values += (0.0,) * (7 - len(values))
        self._link.mav.command_long_send(self._heard.system, 1, command, 0, *values)

    def _ask(self) -> None:
        """Show that we are there; and ask for what is needed until it comes."""
        now, heard, mav = self._now(), self._heard, self._link.mav
        if now - self._heartbeat_at >= _HEARTBEAT_S:
            self._heartbeat_at = now
            mav.heartbeat_send(18, 8, 0, 0, 4)  # a computer on board, itself no autopilot, active
        if self._leader is None and now - self._called_at >= _CALL_S:
            self._called_at = now
            # All that hear: a heartbeat now, not within a second.
            self._command(_SET_INTERVAL, 0, 1e6 / _STREAMS_HZ[0])
        if self._leader is None or now - self._asked_at < _ASK_AGAIN_S:
            return
        self._asked_at = now
        for name in heard.unknown():
            mav.param_request_read_send(heard.system, 1, name.encode(), -1)
        if self._origin and heard.lies is None:
            mav.set_gps_global_origin_send(heard.system, *self._origin)
            self._command(_SAY, _ORIGIN)
        if heard.unready and not heard.armed and now - self._checked_at >= _CHECK_S:
            self._checked_at = now
            self._command(_CHECK)
        # At first in any case, for what comes by itself may come seldom: heartbeats, which tell who leads it, once a second.
        self._asked_streams += 1
        if self._asked_streams <= _ASKED_TIMES or now - heard.said_at > 1.0 or math.isnan(heard.battery):
            # Its origin too, again and again: ArduPilot says that it took one, and takes that of its satellites later.
            streams = (
                _STREAMS_HZ
                | {self._leader.profile.estimate: _ESTIMATE_HZ}
                | ({_ORIGIN: 1} if self._origin else {})
            )
            for number, hz in streams.items():
                self._command(_SET_INTERVAL, number, 1e6 / hz)

    # What it says

    def _look(self) -> None:
        if self._link is None:
            raise VehicleError(f"{self._name} is not open")
        try:
            self._ask()
            for _ in range(_MOST_MESSAGES):
                message = self._link.recv_msg()
                if message is None:
                    break
                self._heard.take(message, self._now())
        except OSError as error:
            raise VehicleError(f"{self._name}: {error.strerror or error}") from error
        except VehicleError as error:
            raise VehicleError(f"{self._name}: {error}") from None
        if self._leader is None and self._heard.profile is not None:
            self._leader = Leader(self._heard.profile, self._rig)

    def _what_is_missing(self) -> str:
        if self._leader is None:
            return "no PX4 or ArduPilot is heard (is it on, and does it speak to this address?)"
        if self._heard.lies is None:
            return f"system {self._heard.system} says no origin of its place (has it enough satellites?)"
        if self._heard.said_at == -math.inf:
            return f"system {self._heard.system} says no local position (does it know where it is?)"
        return f"system {self._heard.system} does not say what its parameter {self._heard.unknown()[0]} is"

    def _ills(self, leader: Leader) -> list[str]:
        ills, heard = [], self._heard
        if leader.taken:
            ills.append(f"a pilot or its own failsafe leads it (custom mode {heard.custom_mode})")
        if not heard.sure(self._now()):
            ills.append(
                "its estimator does not know where it is: give it time, or look at what measures its position"
            )
        if heard.unready and not heard.armed:
            ills.append(f"its own checks do not pass: {heard.check or 'it does not say which'}")
        if math.isnan(heard.battery):
            ills.append("it does not say how full its battery is")
        if heard.others and not self._address.system:
            numbers = ", ".join(map(str, sorted({heard.system, *heard.others})))
            ills.append(f"autopilots {numbers} are heard: say which it is with ?system=NUMBER")
        if (
            leader.profile.stations_matter
            and self._now() - heard.stations.get(_SYSTEM, -math.inf) < _STATION_S
        ):
            ills.append(
                f"a ground station has the number {_SYSTEM} too: its failsafe would hear that one when this computer is gone; "
                "give the station another"
            )
        if heard.lies and math.hypot(*heard.lies) > _FARTHEST_M:
            ills.append(
                f"its origin is {math.hypot(*heard.lies):.0f} m from the room's: the option origin is of elsewhere"
            )
        for name, least, most, why in leader.profile.wanted:
            if not least <= (value := heard.parameters.get(name, UNKNOWN)) <= most:
                ills.append(f"{name} is {value:g}: set it to {most:g} ({why})")
        if heard.refusal and leader.keeper.armed and not heard.armed:
            ills.append(heard.refusal)
        return ills


def parse_address(where: str) -> Address:
    """Raises ValueError, with one line."""
    connection, asks, query = where.partition("?")
    if not _CONNECTION.fullmatch(connection):
        raise ValueError(
            f"{connection!r} is no connection: one reads udpin:127.0.0.1:14550, udpout:HOST:PORT, tcp:HOST:PORT "
            "or serial:/dev/ttyAMA0:921600"
        )
    if not connection.startswith("serial:") and not is_port(int(connection.rpartition(":")[2])):
        raise ValueError(f"{connection!r} is no connection: a port is a number from 1 to 65535")
    asked = dict(parse_qsl(query, keep_blank_values=True))
    if asks and (not asked or asked.keys() - {"autopilot", "system"}):
        raise ValueError("behind the ? stand only autopilot=px4 or autopilot=ardupilot, and system=NUMBER")
    if (name := asked.get("autopilot")) is not None and name not in PROFILES:
        raise ValueError(f"autopilot={name} is none of {', '.join(PROFILES)}")
    system = asked.get("system")
    if system is not None and not (re.fullmatch(r"\d{1,3}", system, re.ASCII) and 1 <= int(system) <= 254):
        raise ValueError(f"system={system} is no number from 1 to 254")
    return Address(connection, PROFILES[name] if name else None, int(system or 0))


def parse_origin(options: Mapping[str, str]) -> tuple[int, int, int] | None:
    """Latitude and longitude in 1e-7 degrees, altitude in mm; None: not given. Raises ValueError, with one line."""
    if (text := options.get("origin")) is None:
        return None
    try:
        latitude, longitude, altitude = (float(part) for part in text.split(","))
    except ValueError:
        latitude = longitude = altitude = math.nan
    if not (abs(latitude) <= 90 and abs(longitude) <= 180 and abs(altitude) <= 10_000):
        raise ValueError(
            f"origin: {text!r} is not LATITUDE,LONGITUDE,ALTITUDE in degrees and metres, for example 47.3977,8.5456,488"
        )
    return round(1e7 * latitude), round(1e7 * longitude), round(1e3 * altitude)


def connected(connection: str) -> Any:
    """pymavlink's connection.

    Raises:
        VehicleError: it is not installed, or cannot be opened.
    """
    os.environ.setdefault("MAVLINK20", "1")  # read when pymavlink is loaded
    try:
        mavutil = importlib.import_module("pymavlink.mavutil")
    except ImportError:
        raise VehicleError(
            f"mavlink:{connection} needs pymavlink: install it with pip install 'rsc-swarm[mavlink]'"
        ) from None
    us: dict[str, Any] = {"source_system": _SYSTEM, "source_component": _COMPONENT}
    try:
        if not connection.startswith("serial:"):
            return mavutil.mavlink_connection(connection, dialect=_DIALECT, **us)
        _, device, baud = connection.split(":")
        mavutil.set_dialect(_DIALECT)
        link = mavutil.mavserial(device, baud=int(baud), **us)
        link.port.exclusive = True  # of two that read one line each gets a part of it
        return link
    except (OSError, OverflowError, ImportError) as error:
        why = _WHY_NOT.get(getattr(error, "errno", None) or 0, str(error))
        raise VehicleError(f"mavlink:{connection} cannot be opened: {why}") from error
