"""The events of a flight: what happened, when, to whom and why; `events.jsonl` of a run directory (docs/recordings.md).

They are read off every drone's path, the mission and the outcome, after the flight. So they cost the flight nothing, a launch has
those of its simulation, and a recording of which they were lost has them still.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from protocols.mission.document import Mission
from protocols.mission.fault import Fault
from protocols.wire.lies import says
from rsc_swarm.flight.detours import detours
from rsc_swarm.flight.report import FlightReport, describe
from rsc_swarm.flight.slot_changes import SlotChange, slot_changes
from rsc_swarm.flight.words import agents_text
from world.outcome import Flown
from world.outlets.judged import findings_of
from world.outlets.trajectory import Trajectory

_WORTH_TELLING_M = 0.05

#: Kinds of events that befall single drones.
BEFALLING = ("kill", "lost", "freeze", "thaw", "restart", "slow", "recover", "lie", "truth")

#: What may happen (`Event.what`), and what that means. Of one tick they are told in this order.
KINDS = {
    "start": "the drones take off",
    "kill": "a drone dies, as the mission says",
    "freeze": "a drone hangs: it senses, hears and answers nothing",
    "thaw": "a drone that hung goes on",
    "restart": "a drone begins anew, knowing nothing",
    "slow": "a drone has only a share of its acceleration left",
    "recover": "a drone has all of its acceleration again",
    "part": "the radio is parted into groups that do not hear each other",
    "heal": "all hear each other again",
    "loss": "the radio loses another share of frames from now on",
    "lie": "a drone says by radio what is not so",
    "truth": "a drone that lied says what is so again",
    "lost": "a drone is out of the air without the mission's doing: struck off, or landed by its failsafe",
    "swap": "two drones exchange their slots",
    "takeover": "a drone takes a slot that another does not hold any more",
    "move": "a drone is in another slot, after what it heard",
    "detour": "a drone that obstacles have stopped flies around them",
    "formed": "the formation stands for the first time",
    "closest": "the least distance of the flight",
    "success": "the formation stands beyond the goal line and every obstacle",
    "collision": "two drones, or a drone and an obstacle, are too near each other",
    "end": "the flight is over",
}


@dataclass(frozen=True)
class Event:
    """One thing that happened.

    tick, time_s: when. what: of `KINDS`. agents: to whom, by number. text: all of it as a sentence. why: the reason, or "".
    slots: those they have now, in the order of agents, where slots changed. of: from which drone a slot was taken over. obstacle:
    its number. place_m: where, x and y in the mission's frame, m; None where it happened to the radio or to all. lasts_s: how
    long a detour took; None if it did not end.
    """

    tick: int
    time_s: float
    what: str
    agents: tuple[int, ...]
    text: str
    why: str = ""
    slots: tuple[int, ...] = ()
    of: int | None = None
    obstacle: int | None = None
    place_m: tuple[float, float] | None = None
    lasts_s: float | None = None


@dataclass(frozen=True)
class End:
    """How a flight ended, as far as its path does not tell. failure: None after a success; text: the same as a sentence.
    lost: why drones fell without the mission's doing, by drone."""

    failure: str | None
    text: str
    lost: Mapping[int, str] = field(default_factory=dict)


def end_of(flown: Flown, mission: Mission) -> End:
    """The end of a flight that was flown."""
    outcome, ages = flown.outcome, flown.command_ages
    struck_off = {drone.agent: drone.why for drone in outcome.struck_off}
    landed = ages.landed if ages else ()
    return End(outcome.failure, describe(outcome, mission, flown.watched.breach), _lost(struck_off, landed))


def end_told(report: FlightReport) -> End:
    """The end of a flight of which there is the report."""
    struck_off = {drone.agent: drone.why for drone in report.struck_off}
    landed = report.commands.landed if report.commands else ()
    return End(report.failure, report.detail, _lost(struck_off, landed))


def _lost(struck_off: Mapping[int, str], landed: Sequence[int]) -> dict[int, str]:
    by_failsafe = dict.fromkeys(landed, "no fresh command reached it, and its failsafe landed it")
    return by_failsafe | {agent: f"it is struck off: {why}" for agent, why in struck_off.items()}


def json_lines(events: Sequence[Event]) -> str:
    """One line per event, all fields in each."""
    return "".join(json.dumps(asdict(event), ensure_ascii=False) + "\n" for event in events)


def events_of(path: Trajectory, mission: Mission, end: End) -> list[Event]:
    """Everything that happened in a flight, in order; nothing in one without a row."""
    told = [*_Told(path, mission, end).all()] if len(path.slots) else []
    return sorted(told, key=lambda event: (event.tick, list(KINDS).index(event.what)))


class _Told:
    """What there is to tell of one recording."""

    def __init__(self, path: Trajectory, mission: Mission, end: End) -> None:
        self._path, self._mission, self._end = path, mission, end
        self._last = len(path.slots) - 1
        self._holder = {int(slot): agent for agent, slot in enumerate(path.slots[0])}
        self._faults = [fault for fault in mission.faults if fault.at_tick < self._last]

    def all(self) -> Iterator[Event]:
        number = self._path.slots.shape[1]
        who = tuple(range(number))
        yield self._event(0, "start", who, f"{agents_text(number)} take{'s' if number == 1 else ''} off")
        for place, fault in enumerate(self._mission.faults):
            if fault in self._faults:
                yield from self._fault(fault, f"fault {place} of the mission")
        yield from self._losses()
        for change in slot_changes(self._path, self._slot_error, self._is_silent):
            yield self._slots(change)
        for detour in detours(self._path, self._mission):
            lasts = (
                None if detour.until is None else round((detour.until - detour.tick) * self._path.tick_s, 2)
            )
            back = "is not back at the end" if lasts is None else f"is back after {lasts:.1f} s"
            text = f"agent {detour.agent} flies around obstacle {detour.obstacle} and {back}"
            why = f"obstacle {detour.obstacle} stopped it on the way to its slot"
            yield self._event(
                detour.tick, "detour", (detour.agent,), text, why, obstacle=detour.obstacle, lasts_s=lasts
            )
        yield from self._verdicts()
        yield self._event(self._last, "end", (), self._end.text, self._end.failure or "success", place=False)

    def _event(
        self, tick: int, what: str, agents: tuple[int, ...], text: str, why: str = "", place: bool = True, **more: Any
    ) -> Event:  # fmt: skip
        where = None
        if place and agents and len(agents) < 3:
            x, y = self._path.positions[tick, list(agents)].mean(axis=0).tolist()
            where = round(x, 3), round(y, 3)
        return Event(tick, round(tick * self._path.tick_s, 2), what, agents, text, why, place_m=where, **more)

    def _struck(self, fault: Fault) -> tuple[int, ...]:
        return (*fault.agents, *(self._holder[slot] for slot in fault.slots))

    def _fault(self, fault: Fault, why: str) -> Iterator[Event]:
        if fault.kind == "part":
            groups = " | ".join(_numbers(group) for group in fault.groups)
            left = set(range(self._path.slots.shape[1])).difference(*fault.groups)
            others = f" | {_numbers(sorted(left))}" if left else ""
            text = f"the radio is parted: {groups}{others} hear each other no more"
            yield self._event(
                fault.at_tick, "part", tuple(n for group in fault.groups for n in group), text, why, False
            )
        elif fault.kind == "heal":
            yield self._event(fault.at_tick, "heal", (), "all hear each other again", why, False)
        elif fault.kind == "loss":
            text = f"the radio loses {100 * (fault.loss or 0):g} % of frames from now on"
            yield self._event(fault.at_tick, "loss", (), text, why, False)
        else:
            text = {
                "kill": "dies",
                "freeze": "hangs: it senses, hears and answers nothing",
                "thaw": "goes on",
                "restart": "begins anew, knowing nothing",
                "slow": f"has {100 * fault.factor:.0f} % of its acceleration left",
                "recover": "has all of its acceleration again",
                "lie": f"lies by radio: {fault.lie and says(fault.lie)}",
                "truth": "tells the truth again",
            }[fault.kind]
            # The dead are past all but a restart; who was struck off is past that, too.
            flying = self._path.flying[fault.at_tick + (fault.kind == "restart")]
            for agent in self._struck(fault):
                if not flying[agent]:
                    continue
                yield self._event(fault.at_tick, fault.kind, (agent,), f"agent {agent} {text}", why)

    def _losses(self) -> Iterator[Event]:
        """Drones that fell without the mission's doing."""
        flying = self._path.flying
        killed = {
            (fault.at_tick, agent)
            for fault in self._faults
            if fault.kind == "kill"
            for agent in self._struck(fault)
        }
        for tick, agent in np.argwhere(flying[:-1] & ~flying[1:]).tolist():
            if (tick, agent) in killed:
                continue
            why = self._end.lost.get(agent, "")
            yield self._event(tick, "lost", (agent,), f"agent {agent} is out of the air", why)

    def _slots(self, change: SlotChange) -> Event:
        if change.kind == "swap":
            (a, b), (to_a, to_b) = change.agents, change.slots
            text = f"agents {a} and {b} swap: {a} is in slot {to_a} now, {b} in slot {to_b}"
            why = _why_swapped(*change.ways_m)
        else:
            agent, slot = change.agents[0], change.slots[0]
            text = f"agent {agent} is in slot {slot} now"
            if change.of is None:
                why = (
                    "it began anew" if self._restarted(change.tick, agent) else "it heard of swaps of others"
                )
            else:
                silent = self._is_silent(change.tick, change.of)
                why = f"agent {change.of} {'was silent' if silent else 'left it'}"
                text = f"agent {agent} takes slot {slot}, which agent {change.of} held"
        return self._event(
            change.tick, change.kind, change.agents, text, why, slots=change.slots, of=change.of
        )

    def _restarted(self, tick: int, agent: int) -> bool:
        return any(
            fault.kind == "restart" and fault.at_tick == tick and agent in self._struck(fault)
            for fault in self._faults
        )

    def _is_silent(self, tick: int, agent: int) -> bool:
        if not self._path.flying[tick, agent]:
            return True
        told = [
            fault.kind
            for fault in sorted(self._faults, key=lambda fault: fault.at_tick)
            if fault.kind in ("freeze", "thaw", "restart")
            and fault.at_tick <= tick
            and agent in self._struck(fault)
        ]
        return bool(told) and told[-1] == "freeze"

    def _slot_error(self, tick: int, agent: int, slot: int) -> float:
        layout, path = self._mission.layout, self._path
        target = self._mission.target.speed_mps * path.tick_s * tick
        x, y = layout.offsets[slot] - path.positions[tick, agent]
        return float(np.hypot(x + target, y))

    def _verdicts(self) -> Iterator[Event]:
        """What the referee saw after each tick."""
        verdict = findings_of(self._path, self._mission).verdict[1:]
        if not len(verdict):
            return
        alone = self._path.slots.shape[1] == 1
        if (standing := np.flatnonzero(verdict["standing"])).size and not alone:
            tick = int(standing[0]) + 1
            yield self._event(tick, "formed", (), "the formation stands for the first time", place=False)
        between = np.minimum(verdict["closest_agents_m"], verdict["closest_obstacle_m"])
        tick, nearest = int(between.argmin()) + 1, float(between.min())
        if np.isfinite(nearest):
            seen = verdict[tick - 1]
            obstacle = (
                int(seen["obstacle"]) if seen["closest_obstacle_m"] < seen["closest_agents_m"] else None
            )
            agents = (
                (int(seen["agent_a"]), int(seen["agent_b"])) if obstacle is None else (int(seen["agent_c"]),)
            )
            other = f"agent {agents[-1]}" if obstacle is None else f"obstacle {obstacle}"
            limit = f"less than {self._mission.limits.collision_m:g} m is a collision"
            pair = f"agent {agents[0]} and {other}"
            if nearest < self._mission.limits.collision_m:
                text = f"{pair} collide: {nearest:.2f} m apart"
                yield self._event(tick, "collision", agents, text, limit, obstacle=obstacle)
            else:
                text = f"{pair} are nearest to each other: {nearest:.2f} m, where {limit}"
                yield self._event(tick, "closest", agents, text, obstacle=obstacle)
        formed = np.flatnonzero(verdict["formed"] & ~np.logical_or.accumulate(verdict["collided"]))
        if formed.size:
            what = "the agent is" if alone else "the formation stands"
            text = f"{what} beyond the goal line{' and every obstacle' if len(self._path.obstacles) else ''}"
            yield self._event(int(formed[0]) + 1, "success", (), text, place=False)


def _why_swapped(before: tuple[float, float], after: tuple[float, float]) -> str:
    """What a swap was good for; arguments: how far the two were from their slots, m."""
    saved = sum(before) - sum(after)
    if saved >= _WORTH_TELLING_M:
        return f"it brings them {saved:.1f} m nearer to their slots in all"
    if max(before) - max(after) >= _WORTH_TELLING_M:
        return f"the longer of their ways to a slot is {max(after):.1f} m now, not {max(before):.1f} m"
    return "they agreed by radio"


def _numbers(agents: Sequence[int]) -> str:
    return ", ".join(map(str, agents))
