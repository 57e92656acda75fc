"""What goes wrong in the air, one story each, and how soon a drone does what about it: the table of docs/air.md.

python -m tests.agent.air.faults
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from agent.air.peers import name_of
from agent.air.pilot import Phase
from agent.air.vehicle import Mode
from protocols.wire.beacon import NO_TICK, NOBODY, Beacon, pack_beacon
from protocols.wire.operator import Order
from tests.agent.air.hall import Hall, plan_of
from tests.agent.air.insiders import LIES, Lie, infiltrate

ROOM = {
    "origin_m": [-2.5, 0],
    "scale": 0.25,
    "height_m": 0.8,
    "fence": {"x_m": [-3, 3], "y_m": [-2, 2], "z_m": [0, 1.6]},
}
_WHO = 3  # whom it strikes, where it strikes one
_AT_S = 2.0  # after `go`


@dataclass(frozen=True)
class Told:
    """What came of it. hold_s, land_s: from the fault until the first drone held, and landed; None: nobody did, but at the end.

    others: drones that flew the mission to its end. closest_m: ever, of two in the air, or one and an obstacle.
    """

    what: str
    hold_s: float | None
    land_s: float | None
    why: str
    others: int
    closest_m: float
    slot_error_m: float
    fell: int


def _begin(**given: object) -> Hall:
    """In mid-mission, just before it goes wrong."""
    hall = Hall(plan_of("lab-small", **ROOM), **given)  # type: ignore[arg-type]
    hall.go(_AT_S)
    return hall


def _told(what: str, hall: Hall, since: float) -> Told:
    """Let it go on until all are down."""
    hall.wait(40.0, {Phase.GROUND, Phase.DEAD})
    assert hall.phases <= {Phase.GROUND, Phase.DEAD}, hall.phases
    first: dict[Phase, float] = {}
    why, through = "", 0
    for drone in hall.drones:
        reasons = [reason for _, _, reason in drone.events]
        through += ("over",) in reasons
        for utc_s, phase, reason in drone.events:
            if phase in (Phase.HOLD, Phase.LAND, Phase.DEAD) and reason != ("over",):
                first.setdefault(phase, hall.hall_time(utc_s) - since)
                why = why or reason[0]
    for me in {*range(len(hall.drones))} - hall.alive:  # its vehicle's own failsafe
        for phase, mode in ((Phase.HOLD, Mode.HOLD), (Phase.LAND, Mode.LAND)):
            first[phase] = min(first.get(phase, math.inf), hall.when_mode(me, mode, since) - since)
        why = why or "no setpoints"
    return Told(
        what, first.get(Phase.HOLD), first.get(Phase.LAND), why, through, hall.closest_m, hall.slot_error_m,
        sum(vehicle.state().mode is Mode.DEAD for vehicle in hall.vehicles),
    )  # fmt: skip


def _vehicle(trouble: str, what: str, who: int = _WHO) -> Told:
    at = 5.0  # after it left the ground
    hall = _begin(bodies={who: f"{trouble}@{at:g}"})
    return _told(what, hall, hall.when(who, Phase.CLIMB) + at)


def process_killed(who: int) -> Told:
    hall = _begin()
    hall.alive.discard(who)
    return _told(f"the process of drone {who} is killed", hall, hall.now)


def operator_gone() -> Told:
    hall = Hall(plan_of("lab", height_m=0.8))  # whose mission lasts longer than the patience
    hall.go(_AT_S)
    hall.operator = False
    return _told("the operator is gone", hall, hall.now)


def frames_lost() -> Told:
    chance = Chances(0.3)
    hall = _begin(loses=lambda who, to, now: next(chance))
    return _told("30 % of all that is said is lost", hall, hall.now)


def parted(seconds: float) -> Told:
    hall = Hall(plan_of("lab", height_m=0.8))  # whose mission lasts longer
    hall.go(_AT_S)
    begun, halves = hall.now, ({"0", "2", "5"}, {"1", "3", "4"})
    hall.loses = lambda who, to, now: (
        now < begun + seconds and who != "ground" and not any({who, name_of(to)} <= half for half in halves)
    )
    return _told(f"the swarm is parted in halves for {seconds:g} s", hall, begun)


def deaf() -> Told:
    hall = Hall(plan_of("lab", height_m=0.8))
    hall.go(_AT_S)
    begun = hall.now
    hall.loses = lambda who, to, now: to == _WHO and who != "ground"
    return _told("a drone hears no other", hall, begun)


def clock_off() -> Told:
    hall = _begin()
    hall.clocks[_WHO] = 0.05
    return _told("a drone's clock goes 50 ms ahead", hall, hall.now)


def spoofed() -> Told:
    """Somebody with the key of drone 5 says that drone 0 is right before drone 3, again and again."""
    hall = _begin()
    begun = hall.now
    for _ in range(200):
        (x, y, z) = hall.vehicles[_WHO].state().p
        beacon = Beacon(
            0, 4, 0, NO_TICK, hall.utc_us, (x + 0.2, y, z), (0.0, 0.0, 0.0), 0, NOBODY, 0, 90, True
        )
        hall.inject("5", "beacon", pack_beacon(beacon))
        hall.tick()
    return _told("a drone speaks in another's name", hall, begun)


def insider(lie: Lie) -> Told:
    """With a valid key, in its own name."""
    hall = _begin()
    begun = hall.now
    infiltrate(hall, lie)
    return _told(f"a drone says {lie.__doc__}", hall, begun)


def ordered(order: Order) -> Told:
    hall = _begin()
    begun = hall.now
    hall.order(order)
    return _told(f"the operator orders {order}", hall, begun)


class Chances:
    """Repeatable: whether the next one is lost."""

    def __init__(self, share: float) -> None:
        self._share, self._state = share, 1

    def __next__(self) -> bool:
        self._state = self._state * 48271 % 2147483647
        return self._state / 2147483647 < self._share


STORIES: dict[str, Callable[[], Told]] = {
    "killed": lambda: process_killed(_WHO),
    "leader killed": lambda: process_killed(0),  # before another, in its lane
    "operator": operator_gone,
    "lossy": frames_lost,
    "parted": lambda: parted(3.0),
    "long parted": lambda: parted(6.0),
    "deaf": deaf,
    "clock": clock_off,
    "spoofed": spoofed,
    **{lie.__name__: partial(insider, lie) for lie in LIES},
    "frozen": lambda: _vehicle("frozen", "a drone's position freezes"),
    "jump": lambda: _vehicle("jump", "a drone's position jumps by 2 m"),
    "empty": lambda: _vehicle("empty", "a drone's battery is empty"),
    "tilted": lambda: _vehicle("tilted", "a drone lies on its side"),
    "gust": lambda: _vehicle("gust", "the wind blows a drone out of the fence at 1 m/s", who=5),
    "land": lambda: ordered(Order.LAND),
    "abort": lambda: ordered(Order.ABORT),
    "kill": lambda: ordered(Order.KILL),
}


def row(told: Told) -> str:
    """As the table has it."""
    hold, land = ("" if at is None else f"{at:.2f}" for at in (told.hold_s, told.land_s))
    return f"| {told.what} | {hold} | {land} | {told.why} | {told.others} | {told.closest_m:.2f} |"


if __name__ == "__main__":
    print(
        "| what goes wrong | holds after s | lands after s | why | drones that fly on to the end | closest m |"
    )
    print("| --- | --- | --- | --- | --- | --- |")
    for story in STORIES.values():
        print(row(story()), flush=True)
