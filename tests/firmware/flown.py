"""An autopilot's firmware, simulated by itself, led through the real pymavlink, with an onlooker on another of its ports.

python -m tests.firmware.flown ardupilot 'COMMAND'      # what it does when something goes wrong: the table of docs/hardware.md
"""

import math
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple

from pymavlink import mavutil

from agent.air.autopilots import PROFILES, Profile
from agent.air.telemetry import Telemetry
from agent.air.vehicle import Mode, Rig, Setpoint, State, Vehicle, VehicleError, make_vehicle
from tests.firmware.circle import on_circle

HEIGHT, RADIUS, SPEED = 2.0, 2.0, 1.0
_BOOT_S, _TICK_S, _PATIENCE_S = 120.0, 0.01, 30.0
_ONLOOKER = 250  # nobody's ground station
_BRAKE, _POSCTL = 17, 3 << 16  # in LOITER the sticks of a pilot who is not there would land it


class Ports(NamedTuple):
    """Where it is led, and where another may look on."""

    led: str
    seen: str
    pilot: int  # the custom mode of a pilot who lets it hover


PORTS = {
    "ardupilot": Ports("tcp:127.0.0.1:5760", "tcp:127.0.0.1:5762", _BRAKE),
    "px4": Ports("udpin:127.0.0.1:14540", "udpin:127.0.0.1:14550", _POSCTL),
}


class Told(NamedTuple):
    """Seconds from what goes wrong. stops: it comes to rest. lands: its autopilot begins to. down: its motors are off. infinite:
    never. fell: how fast it sank at the last above the floor [m/s]."""

    stops: float = math.inf
    lands: float = math.inf
    down: float = math.inf
    fell: float = 0.0


class Flown:
    """Attributes: vehicle; seen: what its onlooker heard of it; sticks: whether a pilot holds some, in the middle."""

    def __init__(self, profile: Profile, ports: Ports) -> None:
        self.profile, self.ports = profile, ports
        self.vehicle: Vehicle = make_vehicle(f"mavlink:{ports.led}", Rig(0, (0.0, 0.0, 0.0), 2.0, 3.0))
        self._eye: Any = None
        self.sticks = False
        self.seen = Telemetry(0, profile, (0.0, 0.0, 0.0))

    def open(self) -> None:
        deadline = time.monotonic() + _BOOT_S
        while True:
            try:
                self.vehicle.open(5.0)
                break
            except VehicleError:
                if time.monotonic() > deadline:
                    raise
        self._eye = mavutil.mavlink_connection(
            self.ports.seen, source_system=_ONLOOKER, dialect="ardupilotmega"
        )

    def look(self) -> None:
        """At what it does, from aside."""
        while (message := self._eye.recv_msg()) is not None:
            self.seen.take(message, time.monotonic())

    def pass_by(self, seconds: float = _TICK_S) -> None:
        """Nobody speaks to it."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self.look()
            if self.sticks:
                self._eye.mav.manual_control_send(self.seen.system, 0, 0, 500, 0, 0)
            time.sleep(0.005)

    def until(self, so: Callable[[State], bool], seconds: float = 60.0) -> State:
        deadline = time.monotonic() + seconds
        while not so(state := self.vehicle.state()):
            if time.monotonic() > deadline:
                raise TimeoutError(str(state))
            self.pass_by()
        return state

    def climb(self) -> None:
        self.vehicle.arm()
        self.until(lambda state: state.armed)
        for number in (30, 32, 245):  # attitude, position, landed or not
            self._eye.mav.command_long_send(self.seen.system, 1, 511, 0, number, 20_000, 0, 0, 0, 0, 0)
        self.vehicle.take_off(HEIGHT)
        self.until(lambda state: state.mode is Mode.HOLD)

    def circle(self, seconds: float) -> float:
        """Lead it around; how far it was from where it was to be, on average [m]."""
        (x, y, _), errors, begun = self.vehicle.state().p, [], time.monotonic()
        while (now := time.monotonic() - begun) < seconds:
            setpoint = on_circle(x, y, now, HEIGHT, RADIUS, SPEED)
            self.vehicle.fly(setpoint)
            errors.append(math.dist(setpoint.p, self.vehicle.state().p))
            self.pass_by()
        return sum(errors) / len(errors)

    def told(self, tick: Callable[[], object]) -> Told:
        """What becomes of it; ``tick``: what its drone does all the time."""
        begun, told, sinks = time.monotonic(), Told(), 0.0
        while told.down == math.inf and time.monotonic() - begun < _PATIENCE_S:
            tick()
            self.pass_by()
            now, seen = time.monotonic() - begun, self.seen
            if told.stops == math.inf and math.hypot(*seen.v[:2]) < 0.1:
                told = told._replace(stops=now)
            if told.lands == math.inf and seen.custom_mode == self.profile.land:
                told = told._replace(lands=now)
            if seen.p[2] > 0.3:
                sinks = -seen.v[2]
            if not seen.armed:
                told = told._replace(down=now, fell=sinks)
        return told

    def put_into(self, custom_mode: int) -> None:
        """As a pilot does, with a switch."""
        numbers = (1, *self.profile.mode_numbers(custom_mode), 0, 0, 0, 0, 0, 0)[:7]
        self._eye.mav.command_long_send(self.seen.system, 1, 176, 0, *numbers)

    def close(self) -> None:
        with suppress(OSError):
            self.vehicle.close()
        if self._eye is not None:
            self._eye.close()


def _process_killed(flown: Flown) -> Told:
    flown.vehicle.close()  # as the kernel does for it
    return flown.told(lambda: None)


def _drone_hangs(flown: Flown) -> Told:
    return flown.told(flown.vehicle.state)


def _pilot_takes_it(flown: Flown) -> Told:
    """His sticks are in the middle, and what leads it asks for a place 5 m on."""
    x, y, _ = flown.vehicle.state().p

    def leads_on() -> None:
        flown.vehicle.fly(Setpoint((x + 5.0, y, HEIGHT), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
        flown.vehicle.state()

    flown.put_into(flown.ports.pilot)
    told = flown.told(leads_on)
    if flown.seen.custom_mode != flown.ports.pilot:
        raise TimeoutError(f"no pilot has it: its custom mode is {flown.seen.custom_mode}")
    return told


def _ordered_to_land(flown: Flown) -> Told:
    flown.vehicle.land()
    return flown.told(flown.vehicle.state)


def _ordered_to_die(flown: Flown) -> Told:
    flown.vehicle.kill()
    return flown.told(flown.vehicle.state)


_PILOTED = "a pilot takes it"
STORIES: dict[str, Callable[[Flown], Told]] = {
    "its drone's process is killed": _process_killed,
    "its drone hangs": _drone_hangs,
    _PILOTED: _pilot_takes_it,
    "`land` is ordered": _ordered_to_land,
    "`kill` is ordered": _ordered_to_die,
}


def story(flown: Flown, what: str) -> tuple[float, Told]:
    """Climb, fly a circle, and see what becomes of it; how far it was from the circle on average [m], and that."""
    flown.sticks = what == _PILOTED  # PX4 gives it to nobody whose sticks it does not hear
    flown.climb()
    error = flown.circle(6.0)
    return error, STORIES[what](flown)


@contextmanager
def flying(name: str, command: str) -> Iterator[Flown]:
    """A firmware of its own for each flight, started by ``command``."""
    with subprocess.Popen(shlex.split(command), stdout=subprocess.DEVNULL) as firmware:
        flown = Flown(PROFILES[name], PORTS[name])
        try:
            flown.open()
            yield flown
        finally:
            flown.close()
            firmware.kill()


def _second(at: float) -> str:
    return "" if at == math.inf else f"{at:.2f}"


if __name__ == "__main__":
    name, command, *asked = sys.argv[1:]
    print("| what goes wrong | stands after s | lands after s | down after s | how |")
    print("| --- | --- | --- | --- | --- |")
    for what in STORIES:
        if asked and not any(part in what for part in asked):
            continue
        with flying(name, command) as flown:
            error, told = story(flown, what)
        how = "hovers" if told.down == math.inf else f"sinks at {told.fell:.1f} m/s"
        print(f"| {what} | {' | '.join(map(_second, told[:3]))} | {how} | ({error:.2f} m)", flush=True)
