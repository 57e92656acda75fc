"""The mission: everything that decides a flight, in one validated, frozen document.

A mission file is YAML with the fields below; every field has a default, so an empty file is the standard task
(docs/task.md). Units are in the names. A wrong mission is refused with the field and what would be right.
"""

from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from protocols.dynamics import TICK_S
from protocols.errors import SwarmError
from protocols.mission.formation import Formation, build_formation, default_shape, shape_points
from protocols.mission.policy_name import from_folder

MAX_AGENTS = 250  # agent numbers travel as one byte

Probability = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Point = tuple[float, float]


class MissionError(SwarmError, ValueError):
    """A mission that cannot be flown; the text is one line: the field, what is wrong, what would be right."""


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class FormationSpec(_Section):
    """Shape of the formation. ``auto``: square if N allows one, else hollow triangle, else V."""

    shape: Literal["auto", "square", "triangle", "vee", "line", "custom"] = "auto"
    spacing_m: Positive = 5.0
    slots_m: tuple[Point, ...] | None = Field(None, description="slot positions, only for shape custom")


class Limits(_Section):
    """What a drone can do, and what counts as a collision."""

    acceleration_mps2: Positive = 10.0
    speed_mps: Positive = 10.0
    collision_m: Positive = 0.5


class Target(_Section):
    """The virtual target: starts at the origin and moves along +x."""

    speed_mps: NotNegative = 3.0


class Start(_Section):
    """Where the drones begin: slot offset plus a uniform draw from a disc, with a minimum gap between all."""

    radius_m: NotNegative = 5.0
    gap_m: Positive = 1.0
    scrambled: bool = Field(False, description="drones take off from any pad: slots are given out at random")


class Obstacles(_Section):
    """Discs drawn from the map seed, or exactly those of ``discs`` (x, y, radius)."""

    count: tuple[int, int] = (3, 6)
    x_m: tuple[float, float] = (15.0, 35.0)
    y_m: tuple[float, float] = (-15.0, 15.0)
    radius_m: tuple[Positive, Positive] = (1.0, 2.0)
    discs: tuple[tuple[float, float, Positive], ...] | None = None

    @model_validator(mode="after")
    def _ordered(self) -> "Obstacles":
        for name in ("count", "x_m", "y_m", "radius_m"):
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(f"{name}: [{low}, {high}] is upside down; write the smaller number first")
        if self.count[0] < 0 or self.count[1] > 16:
            raise ValueError("count: give between 0 and 16 obstacles")
        if self.discs is not None and len(self.discs) > 16:
            raise ValueError("discs: give at most 16")
        return self


class Burst(_Section):
    """Gilbert-Elliott channel per directed link: in the bad state every frame is lost."""

    loss: Probability = Field(0.0, description="mean share of frames lost")
    length_s: Positive = Field(0.3, description="mean length of a bad spell")


class Radio(_Section):
    """The medium between drones."""

    range_m: Positive = 6.0
    hops: Annotated[int, Field(ge=1, le=3)] = 3
    frame_rate_hz: Annotated[float, Field(gt=0, le=100)] = 100.0
    memory_s: Positive = Field(0.5, description="how long a neighbour's last frame is believed")
    loss: Probability = 0.0
    burst: Burst = Burst()
    delay_ms: Annotated[float, Field(ge=0, le=500)] = 0.0
    jitter_ms: Annotated[float, Field(ge=0, le=500)] = 0.0
    duplicate: Probability = 0.0
    reorder: Probability = Field(0.0, description="share of frames held back behind later ones")


class Sensing(_Section):
    """What a drone's own sensors see. Obstacles count from their surface."""

    range_m: Positive = 6.0
    neighbours: Literal["sensed", "heard"] = Field(
        "sensed",
        description="neighbours' positions from own sensors, or only from their frames (dead-reckoned)",
    )
    obstacle_memory: bool = Field(True, description="an obstacle once seen is remembered")


class SwapSpec(_Section):
    """Online reconfiguration. ``tree`` is the paper's rule (a follower and its leader); ``contact`` trades slots with
    any drone in radio contact when that shortens the summed squared distances to the two slots."""

    rule: Annotated[
        Literal["off", "tree", "contact"],
        BeforeValidator(lambda rule: "off" if rule is False else rule),  # what YAML makes of a bare off
    ] = "contact"
    protocol: Literal["agreed", "highest-version"] = "agreed"
    margin_m: NotNegative = 0.5
    connected: bool = Field(False, description="demand that all affected drones are linked by radio")
    cooldown_s: Positive = Field(0.2, description="pause of both parties after a swap (the paper: 1 s)")
    answer_s: Positive = 0.5
    silent_s: Positive = Field(4.0, description="a drone unheard by everyone for this long has left its slot")


class Trajectory(_Section):
    """How a planned trajectory is flown; policies that plan nothing ignore it. ``required`` is the paper's inverse dynamics;
    ``blend`` its fusion with the reactive controller when something is nearer than ``blend_radius_m``."""

    tracking: Literal["smooth", "required"] = Field(
        "smooth",
        description="smooth: the plan's own acceleration, corrected; required: the paper's a_req",
    )
    blend: bool = Field(True, description="the nearer an obstacle or drone, the more the reactive controller")
    blend_radius_m: Positive = 2.5
    replan_ticks: Annotated[int, Field(ge=1)] | None = Field(
        None, description="ticks from plan to plan; none: as the policy's model says"
    )


class Fault(_Section):
    """Something that happens to the swarm at a given time."""

    at_s: NotNegative
    kind: Literal["kill", "freeze", "thaw", "restart", "part", "heal", "slow", "recover"]
    agents: tuple[Annotated[int, Field(ge=0)], ...] = ()
    slots: tuple[Annotated[int, Field(ge=0)], ...] = Field(
        (), description="whoever holds these slots at the start"
    )
    groups: tuple[tuple[Annotated[int, Field(ge=0)], ...], ...] = Field(
        (), description="for part: who hears whom"
    )
    factor: Annotated[float, Field(gt=0, le=1)] = Field(
        0.5, description="for slow: share of the limits that is left"
    )

    @property
    def at_tick(self) -> int:
        """The tick at whose beginning it happens."""
        return round(self.at_s / TICK_S)

    @model_validator(mode="after")
    def _complete(self) -> "Fault":
        if self.kind == "part" and len(self.groups) < 2:
            raise ValueError("groups: a part needs at least two groups of agents")
        if self.kind not in ("part", "heal") and not (self.agents or self.slots):
            raise ValueError(f"agents: name at least one agent (or slot) to {self.kind}")
        return self


@lru_cache(maxsize=64)  # missions that differ in their seeds share it
def _plan(spec: FormationSpec, agents: int) -> Formation:
    if spec.shape == "custom":
        points = shape_points("line", agents, spec.spacing_m)
        points[:] = spec.slots_m
    else:
        shape = default_shape(agents) if spec.shape == "auto" else spec.shape
        points = shape_points(shape, agents, spec.spacing_m)
    return build_formation(points, spec.spacing_m)


class Mission(_Section):
    """One flight: who flies, in which formation, where, with which radio, and what goes wrong when."""

    name: str = "plain"
    swarm: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,30}$")] = "rsc"
    agents: Annotated[int, Field(ge=1, le=MAX_AGENTS)] = 25
    policy: str = "rsc-h20"
    aim: Literal["slot", "chain"] = Field(
        "slot",
        description="slot: virtual target + own offset; chain: leader's position + offset (<= hops away)",
    )
    detour: bool = Field(True, description="who is stopped by obstacles plans the shortest way around them")
    safety_filter: bool = True
    formation: FormationSpec = FormationSpec()
    limits: Limits = Limits()
    target: Target = Target()
    start: Start = Start()
    obstacles: Obstacles = Obstacles()
    radio: Radio = Radio()
    sensing: Sensing = Sensing()
    swap: SwapSpec = SwapSpec()
    trajectory: Trajectory = Trajectory()
    faults: tuple[Fault, ...] = ()
    map_seed: Annotated[int, Field(ge=0, lt=2**32)] = 0
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0
    goal_x_m: float = Field(35.0, description="the line every drone must have passed (and every obstacle)")
    edge_tolerance: Positive = 0.1
    hold_s: NotNegative = Field(
        0.0, description="fly on this long after success and report if the formation held"
    )
    time_limit_s: Annotated[float, Field(gt=0, le=3600)] = 21.0

    @property
    def ticks(self) -> int:
        """Ticks until the flight counts as failed."""
        return round(self.time_limit_s / TICK_S)

    @property
    def frame_every(self) -> int:
        """Ticks from one frame of a drone to its next."""
        return max(1, round(1 / (self.radio.frame_rate_hz * TICK_S)))

    @property
    def plan(self) -> Formation:
        """The formation's slots and tree."""
        return _plan(self.formation, self.agents)

    @model_validator(mode="after")
    def _flyable(self) -> "Mission":
        spec = self.formation
        if (spec.shape == "custom") != (spec.slots_m is not None):
            raise ValueError(
                "formation.slots_m: give slot positions together with shape: custom, and only then"
            )
        if spec.slots_m is not None and len(spec.slots_m) != self.agents:
            raise ValueError(
                f"agents: {self.agents}, but formation.slots_m has {len(spec.slots_m)} slots; make them equal"
            )
        if spec.spacing_m < 2 * self.limits.collision_m:
            raise ValueError(
                f"formation.spacing_m: {spec.spacing_m:g} m is too close for limits.collision_m = "
                f"{self.limits.collision_m:g} m; give at least {2 * self.limits.collision_m:g}"
            )
        if self.radio.range_m < spec.spacing_m:
            raise ValueError(
                f"radio.range_m: {self.radio.range_m:g} m is shorter than the formation's edges "
                f"({spec.spacing_m:g} m); give at least {spec.spacing_m:g}"
            )
        try:
            _ = self.plan
        except ValueError as error:
            field = "formation.slots_m" if spec.shape == "custom" else "agents"
            raise ValueError(f"{field}: {error}") from None
        for index, fault in enumerate(self.faults):
            named = [*fault.agents, *fault.slots, *(agent for group in fault.groups for agent in group)]
            if any(agent >= self.agents for agent in named):
                raise ValueError(
                    f"faults.{index}: there is no agent or slot {max(named)}; numbers go from 0 to {self.agents - 1}"
                )
        return self


def explain(error: ValidationError) -> str:
    """Pydantic's findings as one line: field, what is wrong, what would be right."""
    findings = []
    for item in error.errors():
        field = ".".join(str(part) for part in item["loc"])
        text = item["msg"].removeprefix("Value error, ")
        if item["type"] == "extra_forbidden":
            text = f"unknown field; known here: {', '.join(_known_fields(item['loc'][:-1]))}"
        else:
            text = text[0].lower() + text[1:]
            if "input" in item and not item["type"].startswith("value_error"):
                text += f", not {item['input']!r}"
        findings.append(f"{field}: {text}" if field else text)
    return "; ".join(findings)


def _known_fields(place: tuple[int | str, ...]) -> list[str]:
    model: Any = Mission
    for part in place:
        if isinstance(part, int):
            continue
        annotation = model.model_fields[part].annotation
        model = Fault if part == "faults" else annotation
    return sorted(model.model_fields)


def parse_mission(fields: dict[str, Any], source: str = "mission") -> Mission:
    """A mission from plain fields, e.g. of a YAML file or JSON message.

    Raises:
        MissionError: one line, naming ``source``, the field and what would be right.
    """
    try:
        return Mission.model_validate(fields)
    except ValidationError as error:
        raise MissionError(f"{source}: {explain(error)}") from None


def read_mission_fields(path: Path) -> dict[str, Any]:
    """The fields written in a mission file, unvalidated, for merging with command-line options. A policy's file counts from
    the folder of the mission file.

    Raises:
        MissionError: the file is missing, unreadable, or not a YAML mapping.
    """
    try:
        fields = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise MissionError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise MissionError(f"{path}: is not UTF-8 text; give a YAML mission") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f" at line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise MissionError(f"{path}: is not valid YAML{where} ({getattr(error, 'problem', error)})") from None
    if fields is None:
        return {}
    if not isinstance(fields, dict):
        raise MissionError(
            f"{path}: must be a mapping of fields such as 'agents: 25', not a {type(fields).__name__}"
        )
    if isinstance(fields.get("policy"), str):
        fields["policy"] = from_folder(fields["policy"], path.parent)
    return fields
