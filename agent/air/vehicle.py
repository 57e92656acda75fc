"""The port of a vehicle: what a drone's process asks of whatever flies it (a body of the air), and what a vehicle says of itself.

The frame of the room: metres, m/s, m/s²; x east, y north, z up (ENU) from the room's own origin; yaw in radians from x to y.
Where north is in a room, the fleet file decides; a vehicle that speaks NED turns that at its own border (protocols.fleet.place).

- No call waits for the vehicle: a command is passed on, and `Vehicle.state` tells what became of it.
- Whoever flies calls `Vehicle.state` at 100 Hz; a vehicle without a thread of its own does its reading there.
- The failsafe is the vehicle's own, for the process that speaks to it may die: setpoints that stop for `Failsafe.hold_s` are a
  hold, for `Failsafe.land_s` a landing.
"""

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from protocols.errors import BrokenError, SwarmError
from protocols.wire.vehicles import Mode as Mode

Vector = tuple[float, float, float]  #: (x, y, z) in the room


class VehicleError(BrokenError, RuntimeError):
    """The vehicle cannot be reached, or refuses; one line says what is wrong and what would be right."""


class VehicleAddressError(SwarmError, ValueError):
    """An address that no vehicle has; one line says how one is written."""


@dataclass(frozen=True, slots=True)
class State:
    """What a vehicle says of itself.

    Attributes:
        p, v: position [m] and velocity [m/s] in the room. yaw, tilt: radians; tilt is the angle between its up and the room's.
        age_s: since this position was measured, by the vehicle's own knowledge; infinite before the first.
        battery: 0 to 1.
        health: what is wrong with it, in words; empty: nothing.
    """

    p: Vector
    v: Vector
    yaw: float
    tilt: float
    age_s: float
    battery: float
    mode: Mode
    armed: bool
    health: tuple[str, ...] = ()


class Setpoint(NamedTuple):
    """Where to be now, how fast, and what to add: position [m], velocity [m/s], acceleration [m/s²] in the room; yaw [rad]."""

    p: Vector
    v: Vector
    a: Vector
    yaw: float = 0.0


@dataclass(frozen=True)
class Failsafe:
    """After how long without a setpoint a vehicle that follows them holds, and lands [s]."""

    hold_s: float = 0.15
    land_s: float = 1.0


@dataclass(frozen=True)
class Rig:
    """What a vehicle is told when it is made.

    Attributes:
        drone: its number. start: where it stands, in the room. speed_mps, acceleration_mps2: its limits, in the room.
        options: the text values under ``options`` of its drone in the fleet file; what they mean is the vehicle's affair.
        dongle: the radio that it shares with others; None: none, or the one that its address names. swarm: the name of its swarm.
    """

    drone: int
    start: Vector
    speed_mps: float
    acceleration_mps2: float
    failsafe: Failsafe = Failsafe()
    options: Mapping[str, str] = field(default_factory=dict)
    dongle: int | None = None
    swarm: str = "rsc"


class Vehicle(Protocol):
    """A body of the air. Any call may raise `VehicleError`; after `close` none is made."""

    lags: bool
    """Whether it does what it is told so late that who steers by where it is would swing; then it is steered by where it was told
    to be (agent.air.body)."""

    def open(self, timeout_s: float) -> None:
        """Reach it, and return when its state is known.

        Raises:
            VehicleError: it is not there, within ``timeout_s``.
        """

    def state(self) -> State:
        """What it said last. Never waits."""

    def arm(self) -> None:
        """Motors may run; in time ``state().armed`` is true."""

    def take_off(self, height: float) -> None:
        """Climb to ``height`` [m] above the room's floor where it stands, then hold."""

    def fly(self, setpoint: Setpoint) -> None:
        """Follow this until the next; called at 50 to 100 Hz as long as it is to follow."""

    def hold(self) -> None:
        """Stop, and stay there."""

    def land(self) -> None:
        """Come down where it is, motors off; then it is disarmed. No setpoint changes that."""

    def kill(self) -> None:
        """Cut the motors now, wherever it is. No order after this one is obeyed."""

    def close(self) -> None:
        """Let go of it. One that flies is left to its own failsafe."""


class Make(NamedTuple):
    """A kind of vehicle. module, name: of a class that is made of (address, rig). options: those that it knows. shares_radio:
    whether several of them may be led by one dongle."""

    module: str
    name: str
    options: tuple[str, ...] = ()
    shares_radio: bool = False


VEHICLES = {
    "crazyflie": Make("agent.air.crazyflie", "CrazyflieVehicle", ("host",), shares_radio=True),
    "mavlink": Make("agent.air.mavlink", "MavlinkVehicle", ("origin",)),
    "point": Make("agent.air.point", "PointVehicle"),
}


def make_vehicle(address: str, rig: Rig) -> Vehicle:
    """The vehicle at ``address``, ``KIND:WHERE``; what WHERE means is its kind's affair. It is not opened.

    Raises:
        VehicleAddressError: no such kind, its kind cannot read WHERE, or it is told what means nothing to its kind.
        VehicleError: what the kind needs is not installed.
    """
    kind, colon, where = address.partition(":")
    if not colon or kind not in VEHICLES:
        raise VehicleAddressError(
            f"{address!r} is no vehicle: write KIND:WHERE with KIND one of {', '.join(sorted(VEHICLES))}, "
            "for example point:"
        )
    make = VEHICLES[kind]
    if unknown := sorted(rig.options.keys() - set(make.options)):
        known = (
            f"its only option is {make.options[0]}" if make.options else f"a {kind} has none; leave it out"
        )
        raise VehicleAddressError(f"{address} has no option {unknown[0]!r}: {known}")
    if rig.dongle is not None and not make.shares_radio:
        raise VehicleAddressError(f"{address} has no dongle: a {kind} shares no radio; leave dongle out")
    made: Vehicle = getattr(importlib.import_module(make.module), make.name)(where, rig)
    return made
