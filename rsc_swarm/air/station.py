"""The operator's station: what it knows of every drone, what it orders, and scripts of orders. No input or output."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from agent.air.contacts import Contacts, tick_of
from agent.air.log import FlightLog
from agent.air.peers import Said, name_of
from agent.air.pilot import Phase
from agent.air.preflight import disagreement
from agent.air.reach import reach_of
from protocols.dynamics import TICK_S, TICKS_PER_S
from protocols.errors import SwarmError
from protocols.fleet.plan import Plan
from protocols.wire.account import Account, AccountError, read_account
from protocols.wire.beacon import BeaconError, unpack_beacon
from protocols.wire.operator import Order, Word, pack_word

_LOST_S = 2.0
_OFF_S = 0.5
_MOST_CHANGES = 1000  # of phase, of a drone: one that changes it all the time fills no memory
_GO_TICKS = TICKS_PER_S  # ahead: so long an order may take to reach all
# In which phases all are to be when somebody orders what begins something; in the first they were led to.
_BEGINS = {
    Order.ARM: (Phase.GROUND, Phase.ARMED),
    Order.TAKEOFF: (Phase.ARMED,),
    Order.GO: (Phase.FORM,),
}


class OrderError(SwarmError, ValueError):
    """No order, or one that is refused; one line says why."""


@dataclass
class Station:
    """Of an operator who flies ``plan`` with this ``version``.

    Attributes:
        accounts: the last of each drone. events: changes of phase: UTC [s], drone, phase, why. leaving: the operator leaves when
        all are down.
    """

    plan: Plan
    version: str
    started_us: int
    contacts: Contacts = field(init=False)
    accounts: dict[int, Account] = field(default_factory=dict)
    events: list[tuple[float, int, str, tuple[str, ...]]] = field(default_factory=list)
    go_tick: int | None = None
    leaving: bool = False

    def __post_init__(self) -> None:
        self._word = Word(self.started_us // 1000 & 0xFFFFFFFF, Order.NONE, 0, 0)
        self.log, self.contacts = FlightLog(self.plan), Contacts(None, reach_of(self.plan))

    def hear(self, said: Said, now: float) -> None:
        """What a drone said; what cannot be, or in another's name, is not heard."""
        try:
            if said.kind == "beacon":
                beacon, _ = unpack_beacon(said.data)
                if name_of(beacon.sender) == said.who and beacon.sender < self.plan.mission.agents:
                    self.contacts.hear(beacon, b"", said.at_us, now)
            elif said.kind == "account":
                account = read_account(said.data)
                if str(account.drone) == said.who and account.drone < self.plan.mission.agents:
                    before = self.accounts.get(account.drone)
                    phase = Phase(account.phase)
                    if before is None or before.phase != phase:
                        self._changed(
                            said.at_us / 1e6, account.drone, phase, account.reasons if before else ()
                        )
                    self.accounts[account.drone] = account
        except (BeaconError, AccountError, ValueError):
            return

    def _changed(self, utc_s: float, drone: int, phase: Phase, why: tuple[str, ...]) -> None:
        if sum(other == drone for _, other, _, _ in self.events) < _MOST_CHANGES:
            self.events.append((utc_s, drone, phase, why))

    def record(self, utc_us: int, now: float) -> None:
        """Keep where all are."""
        if self.go_tick is not None and tick_of(utc_us) >= self.go_tick and self.in_flight(now):
            self.log.record(tick_of(utc_us) - self.go_tick, self.contacts.known(), now)

    def order(self, order: Order, utc_us: int, now: float) -> None:
        """From now on this is ordered.

        Raises:
            OrderError: preflight is not green, or somebody is not there yet.
        """
        if order in _BEGINS:
            if red := self.red(now):
                more = f"; and {len(red) - 1} more" if red[1:] else ""
                raise OrderError(f"{order}: preflight is not green: {red[0]}{more}")
            for drone, phase in self.phases(now).items():
                if phase not in _BEGINS[order]:
                    raise OrderError(
                        f"{order}: drone {drone}'s motors were cut; end its process and start it again"
                        if phase == Phase.DEAD
                        else f"{order}: drone {drone} is in phase {phase}; wait until all are in {_BEGINS[order][0]}, or land"
                    )
        at_tick = tick_of(utc_us) + _GO_TICKS if order is Order.GO else 0
        if order is Order.GO:
            self.go_tick, self.log = at_tick, FlightLog(self.plan)
        self._word = Word(self._word.number + 1, order, at_tick, 0)

    @property
    def ordered(self) -> Order:
        """What is ordered now."""
        return self._word.order

    def word(self, utc_us: int) -> bytes:
        """What is to be said now, and again and again."""
        return pack_word(self._word._replace(utc_us=utc_us))

    def lost(self, now: float) -> list[int]:
        """The drones that are not heard."""
        known = self.contacts.known()
        return [
            drone
            for drone in range(self.plan.mission.agents)
            if drone not in known or drone not in self.accounts or now - known[drone].heard_at > _LOST_S
        ]

    def red(self, now: float) -> list[str]:
        """What speaks against flying; empty: preflight is green."""
        lost = set(self.lost(now))
        found = [f"drone {drone}: says that it moves as no drone can" for drone in self.contacts.doubted(now)]
        for drone in range(self.plan.mission.agents):
            if behind := self._behind(drone, now):
                found.append(f"drone {drone}: {behind}")
            elif drone in lost:
                found.append(f"drone {drone}: is not heard at {self.plan.fleet.address(drone)}")
            if drone in lost:
                continue
            account = self.accounts[drone]
            found += [
                f"drone {drone}: {text}"
                for text in (*disagreement(self.plan, self.version, account), *account.complaints)
            ]
        return found

    def _behind(self, drone: int, now: float) -> str | None:
        """What is to be said of its clock and the operator's: by them `go` is agreed on."""
        off_s = self.contacts.behind_s(drone, now)
        if off_s is None or abs(off_s) < _OFF_S:
            return None
        way = "behind" if off_s > 0 else "ahead of"
        return f"its clock is {abs(off_s):.1f} s {way} the operator's; keep both by chrony or PTP"

    def phases(self, now: float) -> dict[int, str]:
        """What the drones that are heard are doing."""
        lost = set(self.lost(now))
        return {drone: account.phase for drone, account in sorted(self.accounts.items()) if drone not in lost}

    def in_flight(self, now: float) -> bool:
        """Whether anyone that is heard is."""
        return bool({*self.phases(now).values()} - {Phase.GROUND, Phase.ARMED, Phase.DEAD})


class Step(NamedTuple):
    """One step of a script: an order, the phases in which it is carried out, and how long that may take."""

    name: str
    order: Order | None
    done: frozenset[str]
    within_s: float


_AFTER_GO = frozenset({Phase.FLY, Phase.HOLD, Phase.LAND, Phase.GROUND, Phase.DEAD})
_DOWN = frozenset({Phase.GROUND, Phase.DEAD})
_STEPS = {
    step.name: step
    for step in (
        Step("preflight", None, frozenset(Phase), 30.0),
        Step("arm", Order.ARM, frozenset({Phase.ARMED}), 10.0),
        Step("takeoff", Order.TAKEOFF, frozenset({Phase.FORM}), 30.0),
        Step("go", Order.GO, _AFTER_GO, 5.0),
        Step("hold", Order.HOLD, frozenset({Phase.HOLD, Phase.LAND, *_DOWN}), 5.0),
        Step("land", Order.LAND, _DOWN, 60.0),
        Step("abort", Order.ABORT, _DOWN, 60.0),
        Step("kill", Order.KILL, frozenset({Phase.DEAD}), 5.0),
    )
}
_BEFORE_GO = ("preflight", "arm", "takeoff")


def read_script(text: str, plan: Plan) -> list[Step]:
    """Steps with commas between; ``wait=5`` waits so many seconds. At the end all are waited for to be down.

    Raises:
        OrderError: one of them is none.
    """
    steps = []
    for word in filter(None, (word.strip() for word in text.split(","))):
        name, _, seconds = word.partition("=")
        if name == "wait" and seconds.replace(".", "", 1).isdecimal():
            steps.append(Step("wait", None, frozenset(), float(seconds)))
        elif word in _STEPS:
            steps.append(_STEPS[word])
        else:
            raise OrderError(f"--do: {word!r} is no step; known: {', '.join(_STEPS)}, wait=SECONDS")
    if not steps:
        raise OrderError(
            "--do: nothing; write steps with commas between, for example preflight,arm,takeoff,go"
        )
    return [*steps, Step("landing", None, _DOWN | {Phase.ARMED}, plan.ticks * TICK_S + 60.0)]


class Script:
    """Steps, carried out one after the other. ``failed``: why it ended before its time. ``say`` is told of each step."""

    def __init__(self, steps: list[Step], say: Callable[[str], None]) -> None:
        self._steps, self._say = steps, say
        self._since: float | None = None
        self.failed: str | None = None

    @property
    def over(self) -> bool:
        return not self._steps

    def advance(self, station: Station, utc_us: int, now: float) -> None:
        """Go on as far as it goes now. A step that fails before `go` is an abort, and the end."""
        if self.over:
            return
        step = self._steps[0]
        try:
            if self._since is None:
                self._since = now
                if step.order:
                    station.order(step.order, utc_us, now)
                    return
        except OrderError as error:
            self._fail(step, str(error), station, utc_us, now)
            return
        waited = now - self._since
        if (waited >= step.within_s) if step.name == "wait" else _done(step, station, now):
            self._say(f"{step.name}: done after {waited:.1f} s")
            del self._steps[0]
            self._since = None
        elif waited > step.within_s:
            self._fail(step, _why(step, station, now), station, utc_us, now)

    def _fail(self, step: Step, why: str, station: Station, utc_us: int, now: float) -> None:
        self.failed = why
        self._say(f"{step.name}: failed: {why}")
        self._since = None
        self._steps = self._steps[-1:] if step.name != "landing" else []
        if step.name in _BEFORE_GO and step.name != "preflight":
            station.order(Order.ABORT, utc_us, now)


def _done(step: Step, station: Station, now: float) -> bool:
    if step.name == "preflight":
        return not station.red(now)
    phases = station.phases(now)
    if step.name in _BEFORE_GO and station.lost(now):
        return False
    return set(phases.values()) <= step.done


def _why(step: Step, station: Station, now: float) -> str:
    if step.name in _BEFORE_GO and (red := station.red(now)):
        return "; ".join(red[:5])
    late = [
        f"drone {drone} is in {phase}"
        for drone, phase in station.phases(now).items()
        if phase not in step.done
    ]
    return f"after {step.within_s:g} s {', '.join(late) or 'nobody is heard'}"
