"""How soon an autopilot and its drone do something about what goes wrong, behind pymavlink: the table of docs/hardware.md.

    python -m tests.agent.air.autopilot_faults

Fakes with the manners of PX4 and ArduPilot, the real pymavlink, and a time that passes when it is told to: the same every time.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

from agent.air.vehicle import Mode, Setpoint
from tests.agent.air.led import HEIGHT, START, Flight
from tests.fakes.autopilot import FakeAutopilot, Make

_TICK_S, _SPEED_MPS, _PATIENCE_S = 0.01, 0.5, 20.0
_STANDS_MPS = 0.05


class Told(NamedTuple):
    """Seconds from the fault. knows: its drone; stops: it comes to rest; lands: its autopilot, or its drone, begins to bring it
    down; down: its motors are off. infinite: never. fell: how fast it met the floor, if that was too fast [m/s]."""

    knows: float = math.inf
    stops: float = math.inf
    lands: float = math.inf
    down: float = math.inf
    fell: float = 0.0


def _flown(make: Make) -> Flight:
    """In mid-flight, just before it goes wrong."""
    flight = Flight(FakeAutopilot(make, START))
    flight.climb()
    flight.go((3.0 * _SPEED_MPS, 0.0), 3.0)
    return flight


def _told(flight: Flight, tick: Callable[[], object], knows: Callable[[], bool] = lambda: False) -> Told:
    """Let time pass until it is down; ``tick``: what its drone does in each."""
    fake, begun, told = flight.fake, flight.now, Told()
    while told.down == math.inf and flight.now - begun < _PATIENCE_S:
        tick()
        now, motion = flight.now - begun, fake.motion
        so = {
            "knows": knows(),
            "stops": math.hypot(*motion.v[:2]) < _STANDS_MPS,
            "lands": fake.custom_mode == fake.make.land,
            "down": fake.landed and not fake.armed,
        }
        told = told._replace(
            **{what: now for what, is_so in so.items() if is_so and getattr(told, what) == math.inf}
        )
    return told._replace(fell=fake.fell)


def process_killed(make: Make) -> Told:
    flight = _flown(make)
    return _told(flight, lambda: flight.pass_by(_TICK_S))


def drone_hangs(make: Make) -> Told:
    """It looks at its vehicle, but has nothing more to tell it."""
    flight = _flown(make)
    return _told(flight, lambda: flight.wait(_TICK_S), lambda: flight.vehicle.state().mode is Mode.HOLD)


def link_dead(make: Make) -> Told:
    flight = _flown(make)
    flight.fake.dead_link = True
    return _told(flight, _leading(flight), lambda: flight.vehicle.state().age_s > 0.15)


def pilot_takes_it(make: Make) -> Told:
    """He lets it hover, and does nothing more."""
    flight = _flown(make)
    flight.fake.custom_mode = make.wait
    return _told(flight, _leading(flight), lambda: flight.vehicle.state().mode is Mode.LAND)


def ordered_to_land(make: Make) -> Told:
    flight = _flown(make)
    flight.vehicle.land()
    return _told(flight, lambda: flight.wait(_TICK_S), lambda: flight.vehicle.state().mode is Mode.LAND)


def ordered_to_die(make: Make) -> Told:
    flight = _flown(make)
    flight.vehicle.kill()
    return _told(flight, lambda: flight.wait(_TICK_S), lambda: flight.vehicle.state().mode is Mode.DEAD)


def _leading(flight: Flight) -> Callable[[], None]:
    """Its drone goes on as if nothing were wrong."""
    x, y, _ = flight.fake.motion.p
    begun = flight.now

    def tick() -> None:
        way = _SPEED_MPS * (flight.now - begun)
        flight.vehicle.fly(Setpoint((x + way, y, HEIGHT), (_SPEED_MPS, 0.0, 0.0), (0.0, 0.0, 0.0)))
        flight.wait(_TICK_S)

    return tick


STORIES: dict[str, Callable[[Make], Told]] = {
    "its drone's process is killed": process_killed,
    "its drone hangs": drone_hangs,
    "its link is dead": link_dead,
    "a pilot takes it": pilot_takes_it,
    "`land` is ordered": ordered_to_land,
    "`kill` is ordered": ordered_to_die,
}


def _second(at: float) -> str:
    return "" if at == math.inf else f"{at:.2f}"


def row(what: str, make: Make, told: Told) -> str:
    """As the table has it."""
    how = f"falls, at {told.fell:.1f} m/s" if told.fell else "lands" if told.down < math.inf else "hovers"
    times = " | ".join(map(_second, told[:3]))
    return f"| {what} | {make.name} | {times} | {_second(told.down)} | {how} |"


if __name__ == "__main__":
    print(
        "| what goes wrong | autopilot | its drone knows after s | stands after s | lands after s | down after s | how |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for what, story in STORIES.items():
        for make in Make:
            print(row(what, make, story(make)), flush=True)
