"""The pilot: what a drone is doing, and what makes it do something else. A pure state machine; its rules:

- A drone leaves the ground only step by step: armed, climb, form (at its height, where it took off), fly.
- From the air every way leads down: who holds or lands never flies the mission again.
- Nothing but `KILL` cuts the motors in flight, and nothing brings a drone back from that.
- A vehicle that comes down by itself, by its own failsafe, is not held up.
- An event that the table does not know in a phase changes nothing.
"""

from enum import StrEnum
from typing import NamedTuple

from agent.air.guard import Action, Verdict
from agent.air.vehicle import Mode
from protocols.wire.operator import Order


class Phase(StrEnum):
    """What a drone is doing."""

    GROUND = "ground"
    ARMED = "armed"
    CLIMB = "climb"
    FORM = "form"
    FLY = "fly"
    HOLD = "hold"
    LAND = "land"
    DEAD = "dead"


class Event(StrEnum):
    """What can happen to it."""

    ARM = "arm"
    TAKEOFF = "takeoff"
    CLIMBED = "climbed"
    START = "start"  # the tick agreed on by `go`
    OVER = "over"  # the mission is flown
    HOLD = "hold"
    LAND = "land"
    LANDED = "landed"
    KILL = "kill"


_OF_ITSELF = frozenset(
    {Event.CLIMBED, Event.START, Event.OVER, Event.LANDED}
)  # whatever is ordered in the same tick
_GUARDED = frozenset({Event.HOLD, Event.LAND, Event.KILL})
_LEAVES_S = 5.0  # who is told to take off and stands after so long is not to do so later
IN_FLIGHT = frozenset({Phase.CLIMB, Phase.FORM, Phase.FLY, Phase.HOLD, Phase.LAND})

TABLE: dict[tuple[Phase, Event], Phase] = {
    (Phase.GROUND, Event.ARM): Phase.ARMED,
    (Phase.ARMED, Event.TAKEOFF): Phase.CLIMB,
    (Phase.ARMED, Event.HOLD): Phase.GROUND,
    (Phase.ARMED, Event.LAND): Phase.GROUND,
    (Phase.CLIMB, Event.CLIMBED): Phase.FORM,
    (Phase.CLIMB, Event.HOLD): Phase.HOLD,
    (Phase.CLIMB, Event.LAND): Phase.LAND,
    (Phase.FORM, Event.START): Phase.FLY,
    (Phase.FORM, Event.HOLD): Phase.HOLD,
    (Phase.FORM, Event.LAND): Phase.LAND,
    (Phase.FLY, Event.OVER): Phase.LAND,
    (Phase.FLY, Event.HOLD): Phase.HOLD,
    (Phase.FLY, Event.LAND): Phase.LAND,
    (Phase.HOLD, Event.LAND): Phase.LAND,
    (Phase.LAND, Event.LANDED): Phase.GROUND,
    **{(phase, Event.KILL): Phase.DEAD for phase in Phase},
}


class Pilot(NamedTuple):
    """phase since when [s]; land_at: when who holds lands [s]; reasons: for the last change that was not ordered."""

    phase: Phase = Phase.GROUND
    since: float = 0.0
    land_at: float = 0.0
    reasons: tuple[str, ...] = ()


class Facts(NamedTuple):
    """What a pilot is told each tick.

    now: s, of a clock that never steps. order: new this tick; None: none. mode: of the vehicle. verdict: the guard's. started,
    over: whether the tick of `go` has come, and the last of the mission is past. may_arm: preflight is green. disarmed: it was
    armed, and is not any more.
    """

    now: float
    order: Order | None
    mode: Mode
    verdict: Verdict
    started: bool
    over: bool
    may_arm: bool
    disarmed: bool = False


class Patience(NamedTuple):
    """How long one holds before one lands [s]: usually, and after an abort."""

    hold_s: float
    abort_s: float


def step(pilot: Pilot, facts: Facts, patience: Patience) -> Pilot:
    """The pilot after one tick. The strongest that happens counts: kill, land, hold, then everything else."""
    verdict = facts.verdict if pilot.phase in IN_FLIGHT or pilot.phase is Phase.ARMED else None
    reasons = verdict.reasons if verdict else ()
    for event in _events(pilot, facts, verdict.action if verdict else Action.PASS):
        after = TABLE.get((pilot.phase, event))
        if after is None or after is pilot.phase:
            continue
        wait = patience.abort_s if facts.order is Order.ABORT else patience.hold_s
        told = (event in _GUARDED and reasons) or _told(pilot, event, facts)
        return Pilot(after, facts.now, facts.now + wait, told)
    if pilot.phase is Phase.HOLD and facts.order is Order.ABORT:
        return pilot._replace(land_at=min(pilot.land_at, facts.now + patience.abort_s))
    return pilot


def _told(pilot: Pilot, event: Event, facts: Facts) -> tuple[str, ...]:
    """Why, where the guard has nothing to say."""
    if facts.order and event not in _OF_ITSELF:
        return (f"ordered to {facts.order}",)
    if event is Event.LAND and pilot.phase is Phase.HOLD and facts.now >= pilot.land_at:
        return (f"has held for {facts.now - pilot.since:.0f} s",)
    if event is Event.LAND and pilot.phase is Phase.ARMED:
        return ("the vehicle disarmed itself: take off sooner after arming",)
    if event is Event.LAND and pilot.phase is Phase.CLIMB and facts.mode is Mode.GROUND:
        return ("the vehicle does not leave the ground",)
    if event in (Event.LAND, Event.KILL):
        return (f"the vehicle does so by itself: {facts.mode}",)
    return (str(event),)


def _events(pilot: Pilot, facts: Facts, action: Action) -> list[Event]:
    """What happens in this tick, the strongest first."""
    order, events = facts.order, []
    in_flight, mode = pilot.phase in IN_FLIGHT, facts.mode
    if order is Order.KILL or action is Action.KILL or (in_flight and mode is Mode.DEAD):
        events.append(Event.KILL)
    comes_down = mode is Mode.LAND or (mode is Mode.GROUND and pilot.phase is not Phase.CLIMB)
    stays = pilot.phase is Phase.CLIMB and mode is Mode.GROUND and facts.now - pilot.since > _LEAVES_S
    stays = stays or (pilot.phase is Phase.ARMED and facts.disarmed)
    if order is Order.LAND or action is Action.LAND or (in_flight and comes_down) or stays:
        events.append(Event.LAND)
    if order in (Order.HOLD, Order.ABORT) or action is Action.HOLD:
        events.append(Event.HOLD)
    if pilot.phase is Phase.HOLD and facts.now >= pilot.land_at:
        events.append(Event.LAND)
    if pilot.phase is Phase.LAND and mode is Mode.GROUND:
        events.append(Event.LANDED)
    if pilot.phase is Phase.CLIMB and mode is Mode.HOLD:
        events.append(Event.CLIMBED)
    if facts.over:
        events.append(Event.OVER)
    elif facts.started:
        events.append(Event.START)
    if order is Order.ARM and facts.may_arm:
        events.append(Event.ARM)
    if order is Order.TAKEOFF:
        events.append(Event.TAKEOFF)
    return events
