"""What a drone knows of the others from their beacons: who is heard, where they are by now, whose clock says what. Pure."""

import statistics
from collections import deque
from typing import NamedTuple

from agent.air.guard import Mover
from protocols.dynamics import TICKS_PER_S
from protocols.wire.beacon import Beacon

_AHEAD_TICKS = 10  # of this clock: a frame from later than that is worth nothing
_CLOCK_WINDOW_S = 1.0
_MOVED_ON_S = 1.0  # no longer: then it has stopped, or is somewhere else
_GONE_S = 4.0  # who fell silent in flight is landing by its failsafe, and no longer in the way
_MOST_WAITING = 1024
OPERATOR = -1  # among the numbers of drones, for the clock


class Contact(NamedTuple):
    """What was last heard of a drone, and when [s]."""

    beacon: Beacon
    heard_at: float


class Contacts:
    """What drone ``me`` knows; None: what the operator knows."""

    def __init__(self, me: int | None) -> None:
        self._me = me
        self._known: dict[int, Contact] = {}
        self._late: dict[
            int, deque[tuple[float, float]]
        ] = {}  # by sender: when heard, this time minus its time
        self._waiting: list[tuple[Beacon, bytes]] = []  # frames of ticks that are not past yet here

    def hear(self, beacon: Beacon, frame: bytes, utc_us: int, now: float) -> None:
        """A beacon came, and the frame in it. ``utc_us``: this drone's time; ``now``: s, of a clock that never steps."""
        known = self._known.get(beacon.sender)
        if beacon.sender == self._me or (known and known.beacon.utc_us >= beacon.utc_us):
            return  # doubled, or overtaken
        self._known[beacon.sender] = Contact(beacon, now)
        self.compare_clocks(beacon.sender, beacon.utc_us, utc_us, now)
        if frame and len(self._waiting) < _MOST_WAITING:
            self._waiting.append((beacon, frame))

    def compare_clocks(self, who: int, their_us: int, utc_us: int, now: float) -> None:
        """``who`` said at its time ``their_us`` what came at ``utc_us``."""
        window, late = self._late.setdefault(who, deque()), (utc_us - their_us) / 1e6
        while window and window[-1][1] >= late:
            window.pop()
        window.append((now, late))

    def frames(self, tick: int) -> list[tuple[int, bytes]]:
        """The frames that may be heard in this tick of the mission, and who sent them. One that is ahead waits for its time."""
        due = [(beacon.sender, frame) for beacon, frame in self._waiting if beacon.tick < tick]
        self._waiting = [entry for entry in self._waiting if tick <= entry[0].tick <= tick + _AHEAD_TICKS]
        return due

    def known(self) -> dict[int, Contact]:
        """All that were ever heard, by number."""
        return self._known

    def few_s(self, others: int, now: float) -> float | None:
        """Since at least half of so many others were heard; None: there are no others, or never were so many.

        Who hears fewer may be cut off from a swarm that takes it for dead, and gives its slot to another.
        """
        ages = sorted(now - contact.heard_at for contact in self._known.values())
        half = (others + 1) // 2
        return ages[half - 1] if 0 < half <= len(ages) else None

    def clock_s(self, now: float) -> float | None:
        """This clock minus the median of the others, but for the quickest way of a beacon; None: nobody is heard."""
        for window in self._late.values():
            while window and now - window[0][0] > _CLOCK_WINDOW_S:
                window.popleft()
        best = [window[0][1] for window in self._late.values() if window]
        return statistics.median(best) if best else None

    def movers(self, now: float) -> tuple[Mover, ...]:
        """Those in the air, or silent since they were, moved on to now."""
        return tuple(
            mover_of(contact, now)
            for contact in self._known.values()
            if contact.beacon.flying and now - contact.heard_at < _GONE_S
        )


def mover_of(contact: Contact, now: float) -> Mover:
    """Where a drone is by now, as far as its last beacon tells."""
    beacon, age = contact.beacon, now - contact.heard_at
    moved = min(age, _MOVED_ON_S)
    x, y, z = (at + moved * speed for at, speed in zip(beacon.p, beacon.v, strict=True))
    return Mover(beacon.sender, (x, y, z), beacon.v if age < _MOVED_ON_S else (0.0, 0.0, 0.0))


def tick_of(utc_us: int) -> int:
    """The tick of UTC that a moment lies in."""
    return utc_us * TICKS_PER_S // 1_000_000
