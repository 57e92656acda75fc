"""What a drone knows of the others from their beacons: who is heard, where they are by now, whose clock says what. Pure.

Believed is what a drone can do. One that says that it is where it cannot be so soon, or faster than any is, would else make all
others hold before it; one that says much fills a queue of its own.
"""

import statistics
from collections import deque
from typing import NamedTuple

from agent.air.guard import Mover
from agent.air.reach import Leash, Reach
from protocols.dynamics import TICKS_PER_S
from protocols.wire.beacon import NOBODY, Beacon

_AHEAD_TICKS = 10  # of this clock: a frame from later than that is worth nothing
_CLOCK_WINDOW_S, _PAUSE_S, _BEACON_S = 2.0, 0.5, 0.04  # a busy machine takes a second to read what came
_LATEST_S = 5.0  # older is no news, however late it comes
_MOVED_ON_S = 1.0  # no longer: then it has stopped, or is somewhere else
_GONE_S = 4.0  # who fell silent in flight is landing by its failsafe, and no longer in the way
_MOST_WAITING = 12  # frames of each: those of the future and the newest of the past
_DOUBTED_S = 2.0


class Contact(NamedTuple):
    """What was last heard of a drone and can be, and when it said so [s], as far as the clocks agree."""

    beacon: Beacon
    heard_at: float


class _Window:
    """By how much one clock differs from another, at least, in the last two seconds: what came late says nothing of clocks."""

    def __init__(self, now: float) -> None:
        self._since = self._last = now
        # When, and how much: the least first, then the least after it, ...
        self._least: deque[tuple[float, float]] = deque()

    def add(self, now: float, late_s: float) -> None:
        if now - self._last > _PAUSE_S:
            self._since = now  # what was held up all this time comes first
        self._last = now
        while self._least and self._least[-1][1] >= late_s:
            self._least.pop()
        self._least.append((now, late_s))

    def least(self, now: float) -> float | None:
        """None: it was not heard for so long."""
        least = self.so_far(now)
        return least if now - self._since >= _CLOCK_WINDOW_S else None

    def so_far(self, now: float) -> float | None:
        """As `least`, of as much as was heard; None: nothing."""
        while self._least and now - self._least[0][0] > _CLOCK_WINDOW_S:
            self._least.popleft()
        return self._least[0][1] if self._least else None


class Contacts:
    """What drone ``me`` knows; None: what the operator knows, or a world. ``reach``: of every drone."""

    def __init__(self, me: int | None, reach: Reach) -> None:
        self._me, self._reach = me, reach
        self._known: dict[int, Contact] = {}
        self._leashes: dict[int, Leash] = {}
        self._doubted: dict[int, float] = {}  # when last
        self._clocks: dict[int, _Window] = {}
        # By whom: how late this one comes to it [s], and when that was heard.
        self._echoes: dict[int, tuple[float, float]] = {}
        self._ahead: deque[tuple[float, float]] = deque()  # when, this clock minus the others, as in a window
        self._waiting: dict[int, deque[tuple[int, bytes]]] = {}  # frames of ticks that are not past yet here

    def hear(self, beacon: Beacon, frame: bytes, utc_us: int, now: float) -> None:
        """A beacon came, and the frame in it. ``utc_us``: this drone's time; ``now``: s, of a clock that never steps."""
        known = self._known.get(beacon.sender)
        if beacon.sender == self._me or (known and _overtaken(known.beacon, beacon)):
            return
        late = min(max(0.0, (utc_us - beacon.utc_us) / 1e6), _LATEST_S)
        leash = self._leashes.setdefault(beacon.sender, Leash(self._reach))
        p, v = leash.believed(beacon.p, beacon.v, now - late, now)
        if leash.doubtful:
            self._doubted[beacon.sender] = now
        beacon = beacon._replace(p=p, v=v)
        self._known[beacon.sender] = Contact(beacon, now - late)
        self._clocks.setdefault(beacon.sender, _Window(now)).add(now, (utc_us - beacon.utc_us) / 1e6)
        if beacon.about == self._me:
            self._echoes[beacon.sender] = beacon.late_ms / 1000, now
        if frame:
            self._waiting.setdefault(beacon.sender, deque(maxlen=_MOST_WAITING)).append((beacon.tick, frame))

    def frames(self, tick: int) -> list[tuple[int, bytes]]:
        """The frames that may be heard in this tick of the mission, and who sent them. One that is ahead waits for its time."""
        due = []
        for sender, waiting in self._waiting.items():
            for _ in range(len(waiting)):
                of, frame = waiting.popleft()
                if of < tick:
                    due.append((sender, frame))
                elif of <= tick + _AHEAD_TICKS:
                    waiting.append((of, frame))
        return due

    def behind_s(self, who: int, now: float) -> float | None:
        """By how much that clock is behind this one, and what it says under way, at least [s]; None: unknown."""
        window = self._clocks.get(who)
        return window.so_far(now) if window else None

    def doubted(self, now: float) -> list[int]:
        """Who has said lately that it does what no drone can."""
        return sorted(who for who, at in self._doubted.items() if now - at < _DOUBTED_S)

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

    def lateness(self, turn: int, now: float) -> tuple[int, int]:
        """For a beacon: of one of those that are heard, in ``turn``, how late it comes [ms]; `NOBODY` and 0 if none is."""
        late = [
            (who, least) for who, window in self._clocks.items() if (least := window.least(now)) is not None
        ]
        who, least_s = late[turn % len(late)] if late else (NOBODY, 0.0)
        return who, round(1000 * least_s)

    def clock_s(self, now: float) -> float | None:
        """This clock minus the median of the others; None: unknown.

        Of two clocks that one is ahead to which the other comes later than the other way round, by half the difference: what
        holds up beacons holds them up both ways. That has to last, for ways change.
        """
        fresh_s = _CLOCK_WINDOW_S + 2 * _BEACON_S * len(self._clocks)
        ahead = [
            (least - said_s) / 2
            for who, (said_s, at) in self._echoes.items()
            if now - at < fresh_s and (least := self._clocks[who].least(now)) is not None
        ]
        if ahead:
            off = min(
                statistics.median_low(ahead), statistics.median_high(ahead), key=abs
            )  # of two, not the liar
            while self._ahead and abs(self._ahead[-1][1]) > abs(off):
                self._ahead.pop()
            self._ahead.append((now, off))
        while self._ahead and now - self._ahead[0][0] > _CLOCK_WINDOW_S:
            self._ahead.popleft()
        return self._ahead[0][1] if self._ahead else None

    def movers(self, now: float) -> tuple[Mover, ...]:
        """Those in the air, or silent since they were, moved on to now."""
        return tuple(
            mover_of(contact, now)
            for contact in self._known.values()
            if contact.beacon.flying and now - contact.heard_at < _GONE_S
        )


def _overtaken(last: Beacon, beacon: Beacon) -> bool:
    """Whether it is the same again, or came after a later one. Who stands may have had its clock set back."""
    back_s = (last.utc_us - beacon.utc_us) / 1e6
    return back_s >= 0.0 and (back_s < _LATEST_S or last.flying or beacon.flying)


def mover_of(contact: Contact, now: float) -> Mover:
    """Where a drone is by now, as far as its last beacon tells."""
    beacon, age = contact.beacon, now - contact.heard_at
    moved = min(age, _MOVED_ON_S)
    x, y, z = (at + moved * speed for at, speed in zip(beacon.p, beacon.v, strict=True))
    return Mover(beacon.sender, (x, y, z), beacon.v if age < _MOVED_ON_S else (0.0, 0.0, 0.0))


def tick_of(utc_us: int) -> int:
    """The tick of UTC that a moment lies in."""
    return utc_us * TICKS_PER_S // 1_000_000
