"""The report of a flight: the document for programs (``--json``) and the text for people.

Every field says what it means; docs/report.md is made from here (``rsc-swarm schema --markdown``).
"""

import math
from dataclasses import asdict, replace
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from protocols.dynamics import TICK_S
from protocols.mission.document import Mission
from protocols.printable import printable
from protocols.wire.frames import REASONS
from protocols.wire.status import SWAP_COUNTS
from rsc_swarm.flight.policy_facts import policy_facts
from rsc_swarm.flight.provenance import Provenance, provenance
from rsc_swarm.flight.words import agents_text, lost_text
from world.outcome import Flown, Outcome

Printable = Annotated[str, AfterValidator(printable)]
Failure = Literal["collision", "late", "all-lost", "broken", "interrupted"]
_NAMED = 3  # drones that were struck off, in the sentence about it


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Dropped(_Part):
    """Frames lost, by the rule of the medium that lost them. A frame counts once per receiver in range."""

    partition: int = Field(description="sender and receiver were parted")
    burst: int = Field(description="the link was in a bad spell (Gilbert-Elliott)")
    loss: int = Field(description="independent loss")
    to_nobody: int = Field(description="arrived when the receiver was no longer listening")


class FrameCounts(_Part):
    """The radio traffic of the flight."""

    sent: int = Field(description="broadcasts")
    sent_bytes: int = Field(description="bytes of all broadcasts")
    median_bytes: float = Field(description="median size of a broadcast")
    delivered: int = Field(description="frames heard: a broadcast counts once per receiver")
    delivered_bytes: int = Field(description="bytes of all frames heard")
    out_of_range: int = Field(description="receivers beyond radio range, summed over broadcasts; not a loss")
    dropped: Dropped
    held_back: int = Field(description="frames delayed behind later ones")
    doubled: int = Field(description="frames that arrived twice")
    rejected: dict[Printable, int] = Field(description="frames that drones refused to believe, by reason")


class StruckOff(_Part):
    """A drone that was lost without the mission's doing, or whose account of itself could not be true; the others flew on."""

    agent: int
    at_s: float
    why: Printable


class CommandFigures(_Part):
    """In real time: ages of commands, from the tick that each answers. One older than ``failsafe.after_s`` is not followed."""

    p99_s: float = Field(description="99 % of commands, over all drones and ticks, were no older")
    longest_s: tuple[float, ...] = Field(description="the oldest that each drone had: its longest silence")
    braked_s: tuple[float, ...] = Field(
        description="how long each drone was braked, or held, by its failsafe"
    )
    landed: tuple[int, ...] = Field(
        description="drones that their failsafe landed; they are among lost_agents"
    )


class SwapTotals(_Part):
    """What the drones did about their slots, summed over all drones."""

    proposed: int = Field(description="swaps proposed to another drone")
    committed: int = Field(description="swaps that took place")
    accepted: int = Field(description="promises given to a proposer")
    refused: int = Field(description="proposals refused by the one asked")
    withdrawn: int = Field(description="proposals overtaken by another swap")
    timed_out: int = Field(description="proposals and promises that waited in vain")
    vacated: int = Field(
        description="slots taken over after deaths: those of the dead, and those that their takers left"
    )
    undone: int = Field(description="swaps acted on that a later merge turned off")
    unsealed: int = Field(
        description="swaps heard that lacked the seal of one of their drones, and did not count"
    )


class WatchCounts(_Part):
    """What must hold among the drones' views of who is in which slot, and how long they differed."""

    breach: Printable | None = Field(description="the first broken invariant; null if all held")
    views_differ_s: float = Field(description="time during which not all living drones had the same view")
    agreed_after_s: float | None = Field(
        description="from the last fault (or start) until all had one view; null if they never had"
    )
    allowed_after_s: float | None = Field(
        description="the same, had every frame that arrived told all its sender knew; null if never, or without faults"
    )
    agreed: bool = Field(description="whether all living drones had one view at the end")
    most_swaps_in_a_second: int = Field(description="swaps of the whole swarm in its busiest second")
    undone: int = Field(description="swaps that a merge turned off again")


class FlightReport(_Part):
    """One flight, told completely. Metres, seconds; errors are relative to the edge length."""

    success: bool = Field(
        description="every drone passed the goal line and every obstacle, in formation, in time"
    )
    failure: Failure | None = Field(
        description="null after a success; else what ended the flight; broken: the run says nothing about the controller"
    )
    detail: Printable = Field(description="the outcome as a sentence: who, where, when")
    struck_off: tuple[StruckOff, ...] = Field(
        description="drones taken out of the flight without the mission's doing (agent, at_s, why); they break the run"
    )
    rest_succeeded: bool | None = Field(
        description="in a run that broke: whether those who were left succeeded; else null"
    )
    rest_failure: Printable | None = Field(
        description="in a run that broke: what else ended the flight of those who were left"
    )
    tau_s: float | None = Field(
        description="time of the success that decides (mission field success); null if there was none"
    )
    formed_s: float | None = Field(
        description="when the formation first stood, wherever that was; null if never"
    )
    max_edge_error: float = Field(
        description="worst relative length error of a tree edge, at tau or at the end"
    )
    max_slot_error_m: float = Field(
        description="worst distance of a drone from its slot's target, at tau or at the end"
    )
    min_distance_m: float | None = Field(
        description="smallest distance between two drones or a drone and an obstacle's surface"
    )
    closest: Printable = Field(description="who came that close, where and when")
    paper_tau_s: float | None = Field(
        None, description="time of the paper's success, whichever decides; null if there was none"
    )
    strict_tau_s: float | None = Field(
        None, description="time of the strict success (docs/task.md); null if there was none"
    )
    stood_on: bool | None = Field(
        None, description="whether the formation stood for 2 s after the paper's success; null without one"
    )
    agreed_at_success: bool | None = Field(
        None,
        description="whether all living drones had one view of the slots at the paper's success; null without",
    )
    held_after_success: bool | None = Field(
        description="whether the formation held for hold_s; null if that was not asked"
    )
    overlap_s: float = Field(description="time during which drones claimed the same slot, summed over drones")
    ticks: int = Field(description="length of the flight in ticks of 10 ms")
    time_s: float = Field(description="length of the flight in simulated seconds")
    agents: int = Field(description="drones that started")
    lost_agents: tuple[int, ...] = Field(description="drones out of the air at the end")
    missed_faults: tuple[int, ...] = Field(
        description="faults that did not happen, because the flight was over before: their places in the mission's list, from 0"
    )
    real_time_factor: float = Field(description="simulated seconds per second of wall clock")
    wall_s: float = Field(description="wall-clock seconds from the first tick to the last")
    deadline_misses: int = Field(
        description="answers that came too late for their tick (realtime clock only)"
    )
    commands: CommandFigures | None = Field(
        description="how fresh the commands were by which drones flew; null in lockstep, where none is late"
    )
    digest: Printable = Field(description="hash of every tick's state; equal digests are equal flights")
    policy: Printable = Field(description="the controller")
    map_seed: int = Field(description="seed of the obstacles")
    seed: int = Field(description="seed of start places, radio and slots")
    clock: Literal["lockstep", "realtime"] = Field(description="repeatable, or 100 Hz on the wall clock")
    mode: Literal["launch", "simulate", "world"] = Field(
        description="real processes, all in one, or the world alone and drones from elsewhere"
    )
    frames: FrameCounts
    swaps: SwapTotals
    first_tick_s: float | None = Field(description="launch: seconds from the command to the first tick")
    pss_mb_per_agent: float | None = Field(
        description="launch: memory of one drone's process (PSS), mean, MB"
    )
    watch: WatchCounts
    flown_with: Provenance
    again: Printable = Field(description="the command that flies this flight again, in any folder")
    mission: dict[str, Any] = Field(description="the mission, every field")


def report_of(
    flown: Flown,
    mission: Mission,
    mode: Literal["launch", "simulate", "world"],
    clock: str,
    again: str,
    first_tick_s: float | None = None,
    pss_mb_per_agent: float | None = None,
    flown_with: Provenance | None = None,
) -> FlightReport:
    """The report of ``flown``; ``again`` is the command that flies it once more. flown_with: what is here now, if not given."""
    outcome = flown.outcome
    nearest = outcome.min_distance_m
    return FlightReport.model_validate(
        {
            **asdict(outcome),
            "struck_off": [drone._asdict() for drone in outcome.struck_off],
            "detail": describe(outcome, mission, flown.watched.breach),
            "min_distance_m": nearest if math.isfinite(nearest) else None,
            "missed_faults": missed_faults(mission, outcome.ticks),
            "time_s": round(outcome.ticks * TICK_S, 2),
            "agents": mission.agents,
            "real_time_factor": flown.real_time_factor,
            "wall_s": flown.wall_s,
            "deadline_misses": flown.deadline_misses,
            "commands": _commands(flown),
            "policy": mission.policy,
            "map_seed": mission.map_seed,
            "seed": mission.seed,
            "clock": clock,
            "mode": mode,
            "frames": _frames(flown),
            "swaps": {name: _total(flown, "swaps", index) for index, name in enumerate(SWAP_COUNTS)},
            "first_tick_s": first_tick_s,
            "pss_mb_per_agent": pss_mb_per_agent,
            "watch": asdict(flown.watched),
            "flown_with": flown_with or provenance(policy_facts(mission).files),
            "again": again,
            "mission": mission.model_dump(mode="json"),
        }
    )


def missed_faults(mission: Mission, ticks: int) -> tuple[int, ...]:
    """Places of the mission's faults that a flight of so many ticks did not come to."""
    return tuple(place for place, fault in enumerate(mission.faults) if fault.at_tick >= ticks)


def _total(flown: Flown, field: str, index: int) -> int:
    """One count of the drones' accounts, summed over all drones."""
    return sum(getattr(status, field)[index] for status in flown.statuses.values())


def _commands(flown: Flown) -> dict[str, Any] | None:
    ages = flown.command_ages
    return {name: getattr(ages, name) for name in CommandFigures.model_fields} if ages else None


def _frames(flown: Flown) -> dict[str, Any]:
    dropped = {rule: flown.tally[rule] for rule in Dropped.model_fields}
    counts = {name: number for name, number in flown.tally.items() if name not in dropped}
    rejected = {reason: _total(flown, "rejected", index) for index, reason in enumerate(REASONS)}
    return {**counts, "median_bytes": flown.median_frame_bytes, "dropped": dropped, "rejected": rejected}


def describe(outcome: Outcome, mission: Mission, breach: str | None = None) -> str:
    """How the flight ended, as a sentence."""
    if outcome.failure == "broken":
        return _describe_broken(outcome, mission, breach)
    if not outcome.success:
        return describe_failure(outcome, mission)
    strictly = " strictly" if mission.success == "strict" else ""
    text = f"{_who(outcome, mission)}{strictly} {_where(outcome, mission)} after {outcome.tau_s:.2f} s"
    if outcome.held_after_success is not None:
        kept = "and held it" if outcome.held_after_success else "but did not hold it"
        text += f" {kept} for {mission.hold_s:g} s more"
    return text


def _describe_broken(outcome: Outcome, mission: Mission, breach: str | None) -> str:
    """What broke the run, and how it ended for the others."""
    reasons = [
        f"agent {agent} was lost at t = {at_s:.2f} s without the mission's doing: {why}"
        for agent, at_s, why in outcome.struck_off[:_NAMED]
    ] or [breach or "an invariant of the slots broke"]
    more = len(outcome.struck_off) - _NAMED
    if more > 0:
        reasons.append(f"and {more} more")
    rest = replace(outcome, success=bool(outcome.rest_succeeded), failure=outcome.rest_failure)
    return f"{'; '.join(reasons)}. Those who were left: {describe(rest, mission)}"


def _who(outcome: Outcome, mission: Mission) -> str:
    if mission.agents == 1:
        return "the agent"
    left = mission.agents - len(outcome.lost_agents)
    if left < mission.agents:
        return f"the {agents_text(left)} left of {mission.agents}"
    return "both agents" if left == 2 else f"all {left} agents"


def _where(outcome: Outcome, mission: Mission) -> str:
    """What a flight is for. One drone is no formation, and an empty field has no obstacles to pass."""
    formation = "in formation " if mission.agents - len(outcome.lost_agents) != 1 else ""
    field = mission.obstacles
    empty = not field.discs if field.discs is not None else field.count[1] == 0
    return f"{formation}beyond the goal line{'' if empty else ' and every obstacle'}"


def describe_failure(outcome: Outcome, mission: Mission) -> str:
    """Why the flight failed, as a sentence: who, where, when."""
    when = f"{outcome.ticks * TICK_S:.2f} s"
    alone = mission.agents == 1
    if outcome.failure == "collision":
        return f"{outcome.min_distance_m:.2f} m between {outcome.closest}"
    if outcome.failure == "all-lost":
        return f"{'the agent' if alone else 'every agent'} was lost by t = {when}"
    edges = "" if alone else f"worst edge error {outcome.max_edge_error:.0%}, "
    state = f"{edges}{'' if alone else 'worst '}slot error {outcome.max_slot_error_m:.1f} m"
    if outcome.lost_agents:
        state += f", lost {lost_text(outcome.lost_agents)}"
    if outcome.failure == "interrupted":
        return f"interrupted at t = {when}: {state}"
    formation = "" if alone else "in formation "
    if mission.success == "strict":
        formation = f"strictly {formation}"
    return f"not {formation}beyond the goal line within {when}: {state}"
