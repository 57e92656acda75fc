"""Can a mission be flown? Each check is a pure function that says in one line what is wrong and what would be right.

Fields alone are judged where they stand (protocols.mission.fields); here stands what fields say about each other.
"""

import math
from collections.abc import Callable

from protocols.dynamics import TICK_S, TICKS_PER_S, ticks_of
from protocols.mission import needs
from protocols.mission.fault import Fault
from protocols.mission.fields import MissionFields
from protocols.mission.values import LONGEST_S

RATE_TOLERANCE = 0.002  #: of a frame rate: three digits name one, 33.3 as well as 33.333
_LEAST_DELAY_MS = 500 * TICK_S


def check_mission(mission: MissionFields) -> None:
    """Refuse what cannot be flown.

    Raises:
        ValueError: one line: the field, what is wrong, what would be right.
    """
    for check in _CHECKS:
        check(mission)


def _slots(mission: MissionFields) -> None:
    spec, agents = mission.formation, mission.agents
    if (spec.shape == "custom") != (spec.slots_m is not None):
        raise ValueError("formation.slots_m: give slot positions together with shape: custom, and only then")
    if spec.slots_m is not None and len(spec.slots_m) != agents:
        raise ValueError(
            f"agents: {agents}, but formation.slots_m has {len(spec.slots_m)} slots; make them equal"
        )


def _distances(mission: MissionFields) -> None:
    spec, contact = mission.formation, mission.limits.collision_m
    if spec.spacing_m < 2 * contact:
        raise ValueError(
            f"formation.spacing_m: {spec.spacing_m:g} m is too close for limits.collision_m = {contact:g} m; "
            f"give at least {2 * contact:g}"
        )
    if mission.start.gap_m < contact:
        raise ValueError(
            f"start.gap_m: {mission.start.gap_m:g} m is a collision by limits.collision_m = {contact:g} m; "
            f"give at least {contact:g}"
        )
    if mission.sensing.range_m < 2 * contact:
        raise ValueError(
            f"sensing.range_m: {mission.sensing.range_m:g} m is too short for limits.collision_m = {contact:g} m; "
            f"give at least {2 * contact:g}"
        )
    if mission.radio.range_m < spec.spacing_m:
        raise ValueError(
            f"radio.range_m: {mission.radio.range_m:g} m is shorter than the formation's edges "
            f"({spec.spacing_m:g} m); give at least {spec.spacing_m:g}"
        )


def _layout(mission: MissionFields) -> None:
    try:
        _ = mission.layout
    except ValueError as error:
        field = "formation.slots_m" if mission.formation.shape == "custom" else "agents"
        raise ValueError(f"{field}: {error}") from None


def _target(mission: MissionFields) -> None:
    speed, drones = mission.target.speed_mps, mission.limits.speed_mps
    if speed >= drones:
        raise ValueError(
            f"target.speed_mps: {speed:g} m/s leaves drones of limits.speed_mps = {drones:g} m/s behind; give less than that"
        )


def _time(mission: MissionFields) -> None:
    if mission.fly_s is not None:  # only the beginning is asked for
        return
    least = needs.least_flight_s(mission)
    allowed = LONGEST_S if mission.time_limit_s is None else mission.time_limit_s
    if least > LONGEST_S:
        raise ValueError(
            f"goal_x_m: with target.speed_mps = {mission.target.speed_mps:g} the formation is not beyond the goal line within "
            f"{LONGEST_S:g} s; give a nearer goal or a faster target"
        )
    if least > allowed:
        raise ValueError(
            f"time_limit_s: the formation cannot be beyond the goal line within {allowed:g} s; give at least "
            f"{math.ceil(least * TICKS_PER_S) * TICK_S:.2f}, or fly_s: {allowed:g} to fly only the beginning"
        )


def _acceleration(mission: MissionFields) -> None:
    if mission.fly_s is not None:
        return
    within, given = needs.limit_ticks(mission) * TICK_S, mission.limits.acceleration_mps2
    least = needs.least_acceleration_mps2(mission, within)
    if given < least < math.inf:
        raise ValueError(
            f"limits.acceleration_mps2: with {given:g} m/s² no drone that begins behind is beyond the goal line within "
            f"{within:g} s; give at least {math.ceil(1000 * least) / 1000:g}, or a longer time_limit_s"
        )


def _frame_rate(mission: MissionFields) -> None:
    rate = mission.radio.frame_rate_hz
    every = needs.frame_ticks(rate)
    if every > (limit := needs.limit_ticks(mission)):
        raise ValueError(
            f"radio.frame_rate_hz: at {rate:g} Hz not every drone speaks in a flight of {limit * TICK_S:g} s; "
            f"give at least {TICKS_PER_S / limit:.3g}"
        )
    flown = TICKS_PER_S / every
    if abs(flown - rate) > RATE_TOLERANCE * rate:
        others = sorted(
            {TICKS_PER_S / max(1, every + step) for step in (-1, 0, 1)}, key=lambda hz: abs(hz - rate)
        )
        raise ValueError(
            f"radio.frame_rate_hz: {rate:g} Hz is no frame every so many ticks; the nearest are "
            f"{others[0]:.4g} and {others[1]:.4g}"
        )


def _delays(mission: MissionFields) -> None:
    radio = mission.radio
    if 0 < radio.delay_ms + radio.jitter_ms < _LEAST_DELAY_MS:
        field = "delay_ms" if radio.delay_ms else "jitter_ms"
        raise ValueError(
            f"radio.{field}: {getattr(radio, field):g} ms is nothing in ticks of {1000 * TICK_S:g} ms; "
            f"give 0, or at least {_LEAST_DELAY_MS:g}"
        )


def _waits(mission: MissionFields) -> None:
    radio, swap = mission.radio, mission.swap
    for field, given, least, why in (
        (
            "radio.memory_s",
            radio.memory_s,
            needs.memory_ticks(radio),
            "a frame is forgotten before the next has come",
        ),
        ("swap.answer_s", swap.answer_s, needs.answer_ticks(radio), "no answer can have come"),
        (
            "swap.silent_s",
            swap.silent_s,
            needs.silence_ticks(radio, mission.agents),
            "drones that live are taken for dead",
        ),
    ):
        if given is not None and ticks_of(given) < least:
            raise ValueError(
                f"{field}: after {given:g} s {why}, as this radio goes; give at least {least * TICK_S:.2f}, or leave it out"
            )


def _burst(mission: MissionFields) -> None:
    burst = mission.radio.burst
    if 0 < burst.loss < 1:
        least = TICK_S * burst.loss / (1 - burst.loss)
        if burst.length_s < least * (1 - 1e-9):
            raise ValueError(
                f"radio.burst.length_s: {burst.length_s:g} s is too short for spells that lose {burst.loss:g} of all frames; "
                f"give at least {least:.2g}"
            )


def _faults(mission: MissionFields) -> None:
    end = needs.limit_ticks(mission) + ticks_of(mission.hold_s)
    state = _SwarmState()
    for index, fault in sorted(enumerate(mission.faults), key=lambda entry: entry[1].at_tick):
        place = f"faults.{index}"
        named = [*fault.agents, *fault.slots, *(agent for group in fault.groups for agent in group)]
        if any(agent >= mission.agents for agent in named):
            raise ValueError(
                f"{place}: there is no agent or slot {max(named)}; numbers go from 0 to {mission.agents - 1}"
            )
        if fault.at_tick >= end:
            raise ValueError(
                f"{place}.at_s: {fault.at_s:g} s is after the end of the flight ({end * TICK_S:g} s); give less, "
                "or a longer time_limit_s"
            )
        # In a scrambled start nobody knows beforehand which drone a slot means.
        key = "slot" if mission.start.scrambled else "drone"
        struck = [("drone", agent) for agent in fault.agents] + [(key, slot) for slot in fault.slots]
        if len(set(struck)) < len(struck):
            raise ValueError(f"{place}: names a drone twice; name each once")
        if wrong := state.apply(fault, struck, unsure=mission.start.scrambled):
            raise ValueError(
                f"{place}: {wrong} at {fault.at_s:g} s; leave this {fault.kind} out, or change the time"
            )
        if state.dead == mission.agents:
            raise ValueError(f"{place}: with it all are dead at {fault.at_s:g} s; leave at least one alive")
        for earlier, other in enumerate(mission.faults[:index]):
            if _undoes(fault, other):
                raise ValueError(
                    f"{place}: this {fault.kind} undoes faults.{earlier} in the same tick, {fault.at_s:g} s; "
                    "leave one of them out, or change a time"
                )


_UNDONE_BY = {
    "thaw": "freeze",
    "restart": "kill",
    "recover": "slow",
    "heal": "part",
    "part": "part",
    "loss": "loss",
    "truth": "lie",
    "lie": "lie",
}


def _undoes(fault: Fault, other: Fault) -> bool:
    """Whether nothing is left of another fault that strikes in the same tick."""
    met = (
        {*fault.agents} & {*other.agents}
        or {*fault.slots} & {*other.slots}
        or not (fault.agents or fault.slots)
    )
    return fault.at_tick == other.at_tick and _UNDONE_BY.get(fault.kind) == other.kind and bool(met)


class _SwarmState:
    """What the faults so far have done: dead, frozen, slowed, lying drones, a parted radio."""

    def __init__(self) -> None:
        self._struck: dict[str, set[tuple[str, int]]] = {
            kind: set() for kind in ("kill", "freeze", "slow", "lie")
        }
        self._parted = False
        self._kinds: set[str] = set()  # how drones were named so far

    @property
    def dead(self) -> int:
        """How many are dead, at least."""
        return max(sum(kind == who for kind, _ in self._struck["kill"]) for who in ("drone", "slot"))

    def apply(self, fault: Fault, struck: list[tuple[str, int]], unsure: bool) -> str | None:
        """Take in one fault; why it would have no effect, or None. ``unsure``: a slot and an agent may be one drone."""
        kind = fault.kind
        self._kinds |= {who for who, _ in struck}
        sure = not (unsure and len(self._kinds) > 1)
        dead, frozen, slowed, lying = (self._struck[of] for of in ("kill", "freeze", "slow", "lie"))
        wrong = None
        if kind == "heal" and not self._parted:
            wrong = "the radio is not parted"
        elif sure:
            for who, without, state in (
                ("kill", dead, "dead already"),
                ("freeze", dead | frozen, "dead or frozen already"),
            ):
                if kind == who and (
                    bad := [f"{name} {number}" for name, number in struck if (name, number) in without]
                ):
                    wrong = f"{bad[0]} is {state}"
            for who, within, state in (
                ("thaw", frozen, "not frozen"),
                ("recover", slowed, "not slowed"),
                ("truth", lying, "not lying"),
            ):
                if kind == who and (
                    bad := [f"{name} {number}" for name, number in struck if (name, number) not in within]
                ):
                    wrong = f"{bad[0]} is {state}"
        if kind in self._struck:
            self._struck[kind].update(struck)
        elif kind == "thaw":
            frozen.difference_update(struck)
        elif kind == "recover":
            slowed.difference_update(struck)
        elif kind == "truth":
            lying.difference_update(struck)
        elif kind == "restart":
            dead.difference_update(struck)
            frozen.difference_update(struck)
        elif kind in ("part", "heal"):
            self._parted = kind == "part"
        return wrong


_CHECKS: tuple[Callable[[MissionFields], None], ...] = (
    _slots,
    _distances,
    _layout,
    _target,
    _time,
    _acceleration,
    _delays,
    _frame_rate,
    _burst,
    _waits,
    _faults,
)
