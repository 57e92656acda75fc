"""The fields of a mission, section by section, each with its default and its limits; units are in the names.

What fields need of each other is in protocols.mission.needs and protocols.mission.checks; protocols.mission.document puts all
together.
"""

from functools import lru_cache
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field, Strict, model_validator

from protocols.dynamics import TICK_S, TICKS_PER_S
from protocols.mission.fault import Fault
from protocols.mission.formation import Formation, build_formation, default_shape, shape_points
from protocols.mission.values import (
    LONGEST_S,
    Count,
    Flag,
    Line,
    NotNegative,
    Number,
    Number32,
    Place,
    Point,
    Positive,
    Probability,
    Seconds,
    Section,
    Span,
)
from protocols.relative import MAX_HOPS
from protocols.wire.keys import checked_swarm
from protocols.wire.sensed import MAX_OBSTACLES

MAX_SWARM = 1024  # drones that one process flies; as processes of their own: protocols.wire.keys.MAX_AGENTS


class FormationSpec(Section):
    """Shape of the formation. ``auto``: square if N allows one, else hollow triangle, else V."""

    shape: Literal["auto", "square", "triangle", "vee", "line", "custom"] = "auto"
    spacing_m: Positive = 5.0
    slots_m: tuple[Point, ...] | None = Field(None, description="slot positions, only for shape custom")


class Limits(Section):
    """What a drone can do, and what counts as a collision."""

    acceleration_mps2: Positive = 10.0
    speed_mps: Positive = 10.0
    collision_m: Positive = 0.5


class Target(Section):
    """The virtual target: starts at the origin and moves along +x."""

    speed_mps: NotNegative = 3.0


class Start(Section):
    """Where the drones begin: slot offset plus a uniform draw from a disc, with a minimum gap between all."""

    radius_m: NotNegative = 5.0
    gap_m: Positive = 1.0
    scrambled: Flag = Field(False, description="drones take off from any pad: slots are given out at random")


class Obstacles(Section):
    """Discs drawn from the map seed, or exactly those of ``discs`` (x, y, radius)."""

    count: tuple[Count, Count] = (3, 6)
    x_m: tuple[Place, Place] = (15.0, 35.0)
    y_m: tuple[Place, Place] = (-15.0, 15.0)
    radius_m: tuple[Positive, Positive] = (1.0, 2.0)
    discs: tuple[tuple[Place, Place, Positive], ...] | None = None

    @model_validator(mode="after")
    def _ordered(self) -> "Obstacles":
        for name in ("count", "x_m", "y_m", "radius_m"):
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(f"{name}: [{low}, {high}] is upside down; write the smaller number first")
        if self.count[0] < 0 or self.count[1] > MAX_OBSTACLES:
            raise ValueError(f"count: give between 0 and {MAX_OBSTACLES} obstacles")
        if self.discs is not None and len(self.discs) > MAX_OBSTACLES:
            raise ValueError(f"discs: give at most {MAX_OBSTACLES}")
        return self


class Burst(Section):
    """Gilbert-Elliott channel per directed link: in the bad state every frame is lost."""

    loss: Probability = Field(0.0, description="mean share of frames lost")
    length_s: Annotated[Number, Field(ge=TICK_S, le=LONGEST_S)] = Field(
        0.3, description="mean length of a bad spell"
    )


class Radio(Section):
    """The medium between drones."""

    range_m: Positive = 6.0
    hops: Annotated[Count, Field(ge=1, le=MAX_HOPS)] = MAX_HOPS
    frame_rate_hz: Annotated[Number, Field(gt=0, le=TICKS_PER_S)] = 100.0
    memory_s: Span | None = Field(
        None,
        description="how long a neighbour's last frame is believed; none: 0.5 s, or until the next has come",
    )
    loss: Probability = 0.0
    burst: Burst = Burst()
    delay_ms: Annotated[Number, Field(ge=0, le=500)] = 0.0
    jitter_ms: Annotated[Number, Field(ge=0, le=500)] = 0.0
    duplicate: Probability = 0.0
    reorder: Probability = Field(0.0, description="share of frames held back behind later ones")


class Sensing(Section):
    """What a drone's own sensors see. Obstacles count from their surface."""

    range_m: Positive = 6.0
    neighbours: Literal["sensed", "heard"] = Field(
        "sensed",
        description="neighbours' positions from own sensors, or only from their frames (dead-reckoned)",
    )
    obstacle_memory: Flag = Field(True, description="an obstacle once seen is remembered")


class SwapSpec(Section):
    """Online reconfiguration. ``tree`` is the paper's rule (a follower and its leader); ``contact`` trades slots with
    any drone in radio contact when that shortens the summed squared distances to the two slots."""

    rule: Annotated[
        Literal["off", "tree", "contact"],
        BeforeValidator(lambda rule: "off" if rule is False else rule),  # what YAML makes of a bare off
    ] = "contact"
    protocol: Literal["agreed", "highest-version"] = "agreed"
    margin_m: NotNegative = 0.5
    connected: Flag = Field(False, description="demand that all affected drones are linked by radio")
    cooldown_s: Span = Field(0.2, description="pause of both parties after a swap (the paper: 1 s)")
    answer_s: Span | None = Field(
        None, description="how long a proposal waits; none: 0.5 s, or until an answer can have come"
    )
    silent_s: Span | None = Field(
        None,
        description="a drone unheard by everyone for this long has left its slot; none: 4 s, or as long as frames need",
    )


class Trajectory(Section):
    """How a planned trajectory is flown; policies that plan nothing ignore it. ``required`` is the paper's inverse dynamics;
    ``blend`` its fusion with the reactive controller when something is nearer than ``blend_radius_m``."""

    tracking: Literal["smooth", "required"] = Field(
        "smooth",
        description="smooth: the plan's own acceleration, corrected; required: the paper's a_req",
    )
    blend: Flag = Field(True, description="the nearer an obstacle or drone, the more the reactive controller")
    blend_radius_m: Positive = 2.5
    blend_with: Literal["analytic", "paper"] = Field(
        "analytic",
        description="the reactive controller: our own, or the paper's obstacle and goal terms alone",
    )
    replan_ticks: Annotated[Count, Field(ge=1, le=1000)] | None = Field(
        None, description="ticks from plan to plan; none: as the policy's model says"
    )


class FailsafeSpec(Section):
    """What a drone does in real time when its last command is older than ``after_s``: it brakes to a hover, and there it holds
    until it hears again, or lands: then it is out of the flight."""

    after_s: Span = 0.3
    then: Literal["hold", "land"] = "hold"


@lru_cache(maxsize=64)  # missions that differ in their seeds share it
def _layout(spec: FormationSpec, agents: int) -> Formation:
    if spec.shape == "custom":
        points = shape_points("line", agents, spec.spacing_m)
        points[:] = spec.slots_m
    else:
        shape = default_shape(agents) if spec.shape == "auto" else spec.shape
        points = shape_points(shape, agents, spec.spacing_m)
    return build_formation(points, spec.spacing_m)


class MissionFields(Section):
    """One flight: who flies, in which formation, where, with which radio, and what goes wrong when."""

    name: Annotated[Line, Field(max_length=200)] = "plain"
    swarm: Annotated[str, Strict(), AfterValidator(checked_swarm)] = "rsc"
    agents: Annotated[Count, Field(ge=1, le=MAX_SWARM)] = 25
    policy: Line = "rsc-h20"
    aim: Literal["slot", "chain"] = Field(
        "slot",
        description="slot: virtual target + own offset; chain: leader's position + offset (<= hops away)",
    )
    detour: Flag = Field(True, description="who is stopped by obstacles plans the shortest way around them")
    safety_filter: Flag = True
    formation: FormationSpec = FormationSpec()
    limits: Limits = Limits()
    target: Target = Target()
    start: Start = Start()
    obstacles: Obstacles = Obstacles()
    radio: Radio = Radio()
    sensing: Sensing = Sensing()
    swap: SwapSpec = SwapSpec()
    trajectory: Trajectory = Trajectory()
    failsafe: FailsafeSpec = FailsafeSpec()
    faults: tuple[Fault, ...] = ()
    map_seed: Number32 = 0
    seed: Number32 = 0
    goal_x_m: Place = Field(35.0, description="the line every drone must have passed (and every obstacle)")
    edge_tolerance: Annotated[Number, Field(gt=0, le=1)] = 0.1
    success: Literal["paper", "strict"] = Field(
        "paper",
        description="which of the two successes decides the flight (docs/task.md); both are reported",
    )
    hold_s: Seconds = Field(
        0.0, description="fly on this long after success and report if the formation held"
    )
    time_limit_s: Span | None = Field(
        None,
        description="after this a flight without success has failed; none: 21 s, or longer for a deeper formation",
    )
    fly_s: Span | None = Field(
        None,
        description="fly only the beginning: end the flight after this, even if success was out of reach by then",
    )

    @property
    def layout(self) -> Formation:
        """The formation's slots and tree."""
        return _layout(self.formation, self.agents)
