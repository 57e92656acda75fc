"""What a drone with a valid key can say on the air that is not so, while its vehicle flies as all do; a story each.

The first line of each says what it tells; it returns the beacons of one tick.
"""

import math
from collections.abc import Callable

from agent.air.pilot import Phase
from protocols.wire.beacon import NO_TICK, NOBODY, Beacon, pack_beacon
from tests.agent.air.hall import Hall

WHO = 3
_TICKS = 4  # so long before each of the others
_BEFORE_M = 0.25

Lie = Callable[[Hall, int], list[bytes]]  #: at so many ticks after it began


def before_all(hall: Hall, tick: int) -> list[bytes]:
    """that it is right before each of the others, one after the other, and comes towards it"""
    (x, y, z), (vx, vy, _) = _state(hall, _victim(hall, tick))
    speed = math.hypot(vx, vy) or 1.0
    ahead = _BEFORE_M / speed
    return [_beacon(hall, (x + ahead * vx, y + ahead * vy, z), (-vx, -vy, 0.0))]


def bullet(hall: Hall, tick: int) -> list[bytes]:
    """that it flies towards each of the others at 100 m/s"""
    (x, y, _), _ = _state(hall, _victim(hall, tick))
    here, _ = _state(hall, WHO)
    far = math.dist((x, y), here[:2])
    return [_beacon(hall, here, (100.0 * (x - here[0]) / far, 100.0 * (y - here[1]) / far, 0.0))]


def many(hall: Hall, tick: int) -> list[bytes]:
    """everything a hundred times over"""
    here, moving = _state(hall, WHO)
    return [_beacon(hall, here, moving, utc_us=hall.utc_us + number) for number in range(100)]


def time_of_day(hall: Hall, tick: int) -> list[bytes]:
    """that all others come half a minute late, in the year 5000"""
    here, moving = _state(hall, WHO)
    about = _victim(hall, tick)
    return [_beacon(hall, here, moving, utc_us=10**17 + hall.utc_us, about=about, late_ms=30_000)]


LIES: tuple[Lie, ...] = (before_all, bullet, many, time_of_day)


def infiltrate(hall: Hall, lie: Lie) -> None:
    """From now on drone `WHO` says this instead of its own beacons."""
    begun, honest = hall.now, hall.drones[WHO].step

    def step(utc_us: int, now: float) -> list[tuple[str, bytes]]:
        said = [each for each in honest(utc_us, now) if each[0] != "beacon"]
        if hall.drones[WHO].pilot.phase is Phase.FLY:
            said += [("beacon", data) for data in lie(hall, round(100 * (now - begun)))]
        return said

    hall.drones[WHO].step = step  # type: ignore[method-assign]


def _victim(hall: Hall, tick: int) -> int:
    others = [drone.me for drone in hall.drones if drone.me != WHO]
    return others[tick // _TICKS % len(others)]


def _state(hall: Hall, me: int) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    state = hall.vehicles[me].state()
    return state.p, state.v


def _beacon(
    hall: Hall,
    p: tuple[float, float, float],
    v: tuple[float, float, float],
    utc_us: int | None = None,
    about: int = NOBODY,
    late_ms: int = 0,
) -> bytes:
    utc_us = hall.utc_us if utc_us is None else utc_us
    return pack_beacon(Beacon(WHO, 4, WHO, NO_TICK, utc_us, p, v, 0, about, late_ms, 90, True))
