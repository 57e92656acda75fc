"""The fleet file: which vehicles fly a mission in which room, and what keeps them in it.

YAML with the fields below. What a field alone can have wrong is refused here; what fields say about each other and about the
mission, in protocols.fleet.plan. All metres are of the room.
"""

import re
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, Field, Strict, ValidationError, model_validator

from protocols.errors import SwarmError
from protocols.mission.findings import explain_as
from protocols.mission.reading import ReadingError, read_yaml_file
from protocols.mission.values import (
    Count,
    Flag,
    Line,
    Number,
    Place,
    Point,
    Positive,
    Probability,
    Section,
)
from protocols.wire.endpoints import checked_endpoint, is_port
from protocols.wire.keys import MAX_AGENTS, LinkError

LEAST_SCALE, MOST_SCALE = 0.25, 1.0

_ADDRESS = re.compile(r"(udp|quic|tls|tcp)/(.+):([0-9]{1,5})")
_KEY = re.compile(r"([\w.-]+/)*[\w.-]*\{number\}[\w.-]*(/[\w.-]+)*")
SPARE = 1000  # ports from the first to the second of who listens by quic


def _checked_address(address: str) -> str:
    match = _ADDRESS.fullmatch(address)
    if not match or not is_port(int(match[3])):
        raise ValueError(
            f"{address!r} is no address; write quic/HOST:PORT, or udp/HOST:PORT without keys, for example udp/10.0.0.13:7450"
        )
    return address


def host_of(address: str) -> str:
    """The host in an address."""
    match = _ADDRESS.fullmatch(address)
    assert match  # checked when it was read
    return match[2].strip("[]")


def places_of(address: str) -> tuple[str, ...]:
    """Where who has an address listens: there, and for ``quic`` also 1000 ports further up (or down, where there are none).

    A listener of Zenoh's takes one handshake at a time, and waits for half a minute when a farewell amid one gets lost
    (eclipse-zenoh/zenoh, issue 2719). Two are hardly ever held up both.
    """
    protocol, _, place = address.partition("/")
    if protocol != "quic":
        return (address,)
    host, _, port = place.rpartition(":")
    spare = int(port) + (SPARE if is_port(int(port) + SPARE) else -SPARE)
    return address, f"quic/{host}:{spare}"


Address = Annotated[Line, AfterValidator(_checked_address)]
Seconds = Annotated[Number, Field(ge=0.01, le=3600)]  # of waiting for somebody
Soon = Annotated[Number, Field(ge=0.05, le=10)]  # of flying on without knowing
Metres = Annotated[Number, Field(ge=0.01, le=100)]
Milliseconds = Annotated[Number, Field(ge=1, le=10_000)]
Degrees = Annotated[Number, Field(ge=-360, le=360)]
Angle = Annotated[Number, Field(ge=5, le=180)]
Height = Annotated[Number, Field(ge=0.2, le=500)]


class FleetError(SwarmError, ValueError):
    """A fleet that cannot be flown; the text is one line: the field, what is wrong, what would be right."""


class Fence(Section):
    """The part of the room that no drone leaves: west to east, south to north, floor to ceiling."""

    x_m: tuple[Place, Place]
    y_m: tuple[Place, Place]
    z_m: tuple[Place, Place] = (-0.2, 2.5)

    @model_validator(mode="after")
    def _ordered(self) -> "Fence":
        for name in ("x_m", "y_m", "z_m"):
            low, high = getattr(self, name)
            if low >= high:
                raise ValueError(
                    f"{name}: [{low:g}, {high:g}] is upside down; write the smaller number first"
                )
        return self


class Guard(Section):
    """The limits of the guard (agent.air.guard): beyond ``..._hold`` a drone holds, beyond ``..._land`` it lands."""

    fence_margin_m: Metres = Field(0.2, description="room kept between the way of the mission and the fence")
    fence_land_m: Metres = Field(0.5, description="so far outside of the fence it lands")
    position_hold_s: Soon = Field(0.15, description="age of the position")
    position_land_s: Soon = 0.5
    jump_m: Metres = Field(0.5, description="a position that moves so much at once is none")
    clock_hold_ms: Milliseconds = Field(
        20.0, description="difference of the clock from the median of the others"
    )
    clock_land_ms: Milliseconds = 200.0
    peers_hold_s: Seconds = Field(5.0, description="fewer than half of the others heard")
    operator_hold_s: Seconds = Field(5.0, description="the operator not heard")
    operator_land_s: Seconds = 10.0
    battery_arm: Probability = Field(0.5, description="below it no drone is armed")
    battery_land: Probability = 0.2
    battery_land_s: Soon = Field(
        2.0, description="below it for so long it lands: one sags while motors spin up"
    )
    tilt_land_deg: Angle = 50.0
    tilt_kill_deg: Angle = Field(100.0, description="beyond it it has turned over: the motors are cut")
    setpoint_hold_s: Soon = Field(0.15, description="since the last setpoint: the vehicle's own failsafe")
    setpoint_land_s: Soon = 1.0
    reaction_s: Soon = Field(0.15, description="how late it brakes, where it counts on what lies ahead")
    setpoint_m: Metres = Field(1.0, description="a setpoint farther than this from where it is")
    hold_s: Seconds = Field(10.0, description="who has held for so long lands")
    abort_s: Seconds = Field(2.0, description="and after an abort")

    @model_validator(mode="after")
    def _ordered(self) -> "Guard":
        for first, second in (
            ("position_hold_s", "position_land_s"),
            ("setpoint_hold_s", "setpoint_land_s"),
            ("clock_hold_ms", "clock_land_ms"),
            ("operator_hold_s", "operator_land_s"),
            ("tilt_land_deg", "tilt_kill_deg"),
            ("battery_land", "battery_arm"),
        ):
            if getattr(self, first) >= getattr(self, second):
                raise ValueError(
                    f"{first}: {getattr(self, first):g} is not less than {second} = {getattr(self, second):g}; give less"
                )
        return self


class AirRadio(Section):
    """Frames between the drones."""

    frame_rate_hz: Annotated[Number, Field(ge=5, le=100)] = 25.0
    loss: Annotated[Probability, Field(le=0.9)] = Field(
        0.2, description="share of frames expected to be lost"
    )
    port: Annotated[Count, Field(ge=1024, le=64_000)] = Field(
        7450, description="the operator's on this machine; drone i has the i-th after it"
    )
    plain_text: Flag = Field(
        False, description="let udp and tcp leave this machine, where all can read and forge them"
    )


class PositionSource(Section):
    """Who measures from outside where Crazyflies are: a bridge of a motion capture that puts each position on a key of Zenoh."""

    endpoint: Line = Field(description="where it listens, as Zenoh writes it: tcp/127.0.0.1:7447")
    key: Line = Field("position/{number}", description="of one drone; {number}: its number")

    @model_validator(mode="after")
    def _readable(self) -> "PositionSource":
        try:
            checked_endpoint(self.endpoint)
        except LinkError as error:
            raise ValueError(f"endpoint: {error}") from None
        if not _KEY.fullmatch(self.key):
            raise ValueError(
                f"key: {self.key!r} is no key with the drone's number in it; write position/{{number}}, say"
            )
        return self


class WorldSpec(Section):
    """Mixed reality: a world (`rsc-swarm world --bodies external`) carries the frames, and adds obstacles nobody can touch."""

    address: Address | None = Field(None, description="where it is reached; none: on this machine")
    obstacles_m: tuple[tuple[Place, Place, Positive], ...] = Field(
        (), description="x, y, radius of obstacles that only it knows; drones see them when they come near"
    )
    noise_m: Annotated[Number, Field(ge=0, le=0.1)] = Field(
        0.0, description="of what drones see of them: standard deviation"
    )


class DroneSpec(Section):
    """One drone."""

    number: Annotated[Count, Field(ge=0, lt=MAX_AGENTS)]
    body: Line = Field("point:", description="KIND:WHERE, as agent.air.vehicle has it")
    dongle: Annotated[Count, Field(ge=0, le=999)] | None = Field(
        None, description="the radio it is flown by, if it shares one"
    )
    start_m: Point | None = Field(None, description="where it stands; none: at its slot")
    address: Address | None = Field(
        None,
        description="where its process is reached, quic/HOST:PORT or udp/HOST:PORT; none: on this machine",
    )
    options: dict[Line, Annotated[str, Strict()]] = Field({}, description="for its kind of body")


class Fleet(Section):
    """A fleet file."""

    mission: Line = Field(description="a mission that comes with the project, or a file beside this one")
    origin_m: Point = Field(description="where the mission's origin lies in the room")
    yaw_deg: Degrees = Field(0.0, description="where the mission's x points, from east to north")
    scale: Annotated[Number, Field(ge=LEAST_SCALE, le=MOST_SCALE)] = Field(
        0.3, description="metres of the room per metre of the mission"
    )
    height_m: Height = 1.0
    slot_heights_m: tuple[Height, ...] | None = Field(
        None, description="one for each slot, instead of height_m"
    )
    fence: Fence
    obstacles_m: tuple[tuple[Place, Place, Positive], ...] | None = Field(
        None, description="x, y, radius of what stands in the room; none: the mission's own"
    )
    guard: Guard = Guard()
    radio: AirRadio = AirRadio()
    ground: Address | None = Field(None, description="where the operator is reached, as address of a drone")
    world: WorldSpec | None = Field(None, description="for mixed reality; none: drones hear each other")
    positions: PositionSource | None = Field(
        None, description="who tells the radio hosts where Crazyflies are; none: they measure it themselves"
    )
    keys: Line | None = Field(None, description="folder of keys, beside this file; none: all is plain text")
    drones: tuple[DroneSpec, ...]

    def address(self, drone: int) -> str:
        """Where the process of a drone is reached."""
        return self.drones[drone].address or self._here(1 + drone)

    def _here(self, number: int) -> str:
        return f"{'quic' if self.keys else 'udp'}/127.0.0.1:{self.radio.port + number}"

    @property
    def ground_address(self) -> str:
        """Where the operator is reached."""
        return self.ground or self._here(0)

    @property
    def world_address(self) -> str | None:
        """Where the world is reached; None: there is none."""
        return None if self.world is None else self.world.address or self._here(1 + len(self.drones))

    @property
    def addresses(self) -> dict[str, str]:
        """Of everybody, by the fields of the fleet file."""
        drones = {f"drones.{drone.number}.address": self.address(drone.number) for drone in self.drones}
        world = {} if self.world_address is None else {"world.address": self.world_address}
        return {"ground": self.ground_address, **world, **drones}


def parse_fleet(fields: dict[str, Any], source: str = "fleet") -> Fleet:
    """A fleet from plain fields; its drones by their numbers.

    Raises:
        FleetError: one line, naming ``source``, the field and what would be right.
    """
    try:
        fleet = Fleet.model_validate(fields)
    except ValidationError as error:
        raise FleetError(f"{source}: {explain_as(Fleet, error)}") from None
    numbers = sorted(drone.number for drone in fleet.drones)
    if numbers != list(range(len(numbers))):
        raise FleetError(
            f"{source}: drones: their numbers are {', '.join(map(str, numbers)) or 'none'}; "
            "number them from 0, each once, as the mission does"
        )
    return fleet.model_copy(update={"drones": tuple(sorted(fleet.drones, key=lambda drone: drone.number))})


def read_fleet(path: Path) -> Fleet:
    """The fleet in a file.

    Raises:
        FleetError: it cannot be read, or as parse_fleet.
    """
    try:
        fields = read_yaml_file(path)
    except ReadingError as error:
        raise FleetError(str(error)) from None
    return parse_fleet(fields, str(path))
