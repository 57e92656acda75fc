"""A fleet and its mission laid together: the plan of a flight in a room, and whether it can be flown. Pure."""

import hashlib
import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

from protocols.dynamics import TICK_S, ticks_of
from protocols.fleet.document import SPARE, Fleet, FleetError, host_of, places_of
from protocols.fleet.place import Flat, Place
from protocols.mission import needs
from protocols.mission.document import Mission, MissionError, parse_mission
from protocols.wire.endpoints import SECRET, is_here
from protocols.wire.sensed import MAX_OBSTACLES

Disc = tuple[float, float, float]
ONE_OBSTACLE_M = 0.3  # sightings whose centres are no farther apart are of one obstacle

_FAR_M = 100.0  # beyond the way no fence is one
_LANDED_S = 10.0  # from a landing's begin
_SETTLE_S = 2.5  # flown on after the formation can be beyond the goal line


@dataclass(frozen=True)
class Plan:
    """What is flown in the room.

    mission: as the drones fly it: neighbours known from their frames, at the rate of the fleet's radio.
    """

    fleet: Fleet
    mission: Mission

    @cached_property
    def place(self) -> Place:
        """How the mission lies in the room."""
        return _place(self.fleet)

    @property
    def drones_told(self) -> str:
        """How many fly, in words."""
        return f"{self.mission.agents} drone{'s' if self.mission.agents > 1 else ''}"

    @property
    def limit_m(self) -> float:
        """Nearer than this is a collision, in the room."""
        return self.mission.limits.collision_m * self.fleet.scale

    @property
    def speed_mps(self) -> float:
        """No drone is asked to fly faster, in the room."""
        return self.mission.limits.speed_mps * self.fleet.scale

    @property
    def acceleration_mps2(self) -> float:
        """No drone is asked to accelerate more, in the room."""
        return self.mission.limits.acceleration_mps2 * self.fleet.scale

    @cached_property
    def ticks(self) -> int:
        """How long is flown after `go`."""
        return ticks_of(round(needs.least_flight_s(self.mission) + _SETTLE_S + self.mission.hold_s, 1))

    @cached_property
    def starts(self) -> tuple[Flat, ...]:
        """Where each drone stands."""
        slots = self.slots_at(0)
        return tuple(drone.start_m or slots[drone.number] for drone in self.fleet.drones)

    @cached_property
    def obstacles(self) -> tuple[Disc, ...]:
        """Discs of the room."""
        if self.fleet.obstacles_m is not None:
            return self.fleet.obstacles_m
        discs = self.mission.obstacles.discs or ()
        return tuple((*self.place.to_room((x, y)), radius * self.fleet.scale) for x, y, radius in discs)

    @property
    def virtual_obstacles(self) -> tuple[Disc, ...]:
        """Discs of the room that only its world knows."""
        return self.fleet.world.obstacles_m if self.fleet.world else ()

    def in_mission(self, disc: Disc) -> Disc:
        """A disc of the room in the mission's frame."""
        return *self.place.to_mission(disc[:2]), disc[2] / self.fleet.scale

    @cached_property
    def mission_obstacles(self) -> tuple[Disc, ...]:
        """The same in the mission's frame."""
        return tuple(map(self.in_mission, self.obstacles))

    @cached_property
    def goal_x_m(self) -> float:
        """Beyond it, in the mission's frame, the formation has to be; no obstacle of the room reaches over it."""
        return max([self.mission.goal_x_m, *(x + radius for x, _, radius in self.mission_obstacles)])

    def slots_at(self, tick: int) -> tuple[Flat, ...]:
        """Where the slots are in the room, so many ticks after `go`."""
        target = self.mission.target.speed_mps * TICK_S * tick
        return tuple(self.place.to_room((target + x, y)) for x, y in self.mission.layout.offsets.tolist())

    def height(self, slot: int) -> float:
        """At which height a slot flies."""
        heights = self.fleet.slot_heights_m
        return self.fleet.height_m if heights is None else heights[slot]

    @cached_property
    def fleet_digest(self) -> str:
        """Of the fleet file; equal for all who fly together."""
        return _digest(self.fleet.model_dump(mode="json", exclude={"keys"}))

    @cached_property
    def mission_digest(self) -> str:
        """Of the mission; equal for all who fly together."""
        return _digest(self.mission.model_dump(mode="json"))


def make_plan(fleet: Fleet, mission: Mission, source: str = "fleet") -> Plan:
    """The plan of ``fleet`` flying ``mission``.

    Raises:
        FleetError: it cannot be flown; one line: the field, what is wrong, what would be right.
    """
    try:
        _check_before(fleet, mission)
        plan = Plan(fleet, _on_air(fleet, mission))
        for check in _CHECKS:
            check(plan)
    except (FleetError, MissionError) as error:
        raise FleetError(f"{source}: {error}") from None
    return plan


def _place(fleet: Fleet) -> Place:
    return Place(fleet.origin_m, math.radians(fleet.yaw_deg), fleet.scale)


def _digest(fields: object) -> str:
    return hashlib.sha256(json.dumps(fields, sort_keys=True).encode()).hexdigest()[:16]


def _on_air(fleet: Fleet, mission: Mission) -> Mission:
    fields = mission.model_dump(mode="json")
    # Obstacles are on a map, and there is nothing to remember; but a drone that fell silent is one only for a while.
    # What stands in the room decides where the goal line is, and how long is flown.
    if fleet.obstacles_m is not None:
        place = _place(fleet)
        fields["obstacles"] = {
            "discs": [(*place.to_mission((x, y)), radius / fleet.scale) for x, y, radius in fleet.obstacles_m]
        }
    fields["sensing"] |= {"neighbours": "heard", "obstacle_memory": False}
    fields["radio"] |= {"frame_rate_hz": fleet.radio.frame_rate_hz, "loss": fleet.radio.loss}
    # Only who is down for sure loses its slot: cut off from half of the others, it has held and landed by then.
    alone_s = fleet.guard.peers_hold_s + fleet.guard.hold_s + _LANDED_S
    fields["swap"]["silent_s"] = math.ceil(max(alone_s, mission.silent_ticks * TICK_S))
    fields["faults"] = []  # what goes wrong on the air, nobody has to be told
    return parse_mission(fields, f"mission {mission.name}")


def _check_before(fleet: Fleet, mission: Mission) -> None:
    if len(fleet.drones) != mission.agents:
        raise FleetError(
            f"drones: {len(fleet.drones)}, and mission {fleet.mission} is for {mission.agents}; list as many"
        )
    if fleet.slot_heights_m is not None and "height_m" in fleet.model_fields_set:
        raise FleetError("height_m: slot_heights_m says it of each slot; leave one of them out")
    if fleet.world and not fleet.world.obstacles_m and fleet.world.noise_m:
        raise FleetError(
            "world.noise_m: the world adds no obstacles that could be seen with noise; list them, or leave it out"
        )
    if fleet.slot_heights_m is not None and len(fleet.slot_heights_m) != mission.agents:
        raise FleetError(
            f"slot_heights_m: {len(fleet.slot_heights_m)} heights for {mission.agents} slots; give as many"
        )
    by_chance = mission.obstacles.discs is None and mission.obstacles.count[1] > 0
    if by_chance and fleet.obstacles_m is None:
        raise FleetError(
            f"obstacles_m: mission {fleet.mission} draws its obstacles by chance, and a room has its own; "
            "list them, or [] where there are none"
        )


def _check_addresses(plan: Plan) -> None:
    fleet = plan.fleet
    for (one, first), (other, second) in combinations(fleet.addresses.items(), 2):
        if first == second:
            raise FleetError(f"{other}: {second} is that of {one}, too; give each its own address")
        if shared := {*places_of(first)} & {*places_of(second)}:
            raise FleetError(
                f"{other}: {second} and {one}: {first} would both listen at {shared.pop()}, for who has a quic address listens "
                f"{SPARE} ports from it, too; give one of them another port"
            )
    for name, address in fleet.addresses.items():
        protocol = address.partition("/")[0]
        if (protocol in SECRET) != (fleet.keys is not None):
            raise FleetError(
                f"{name}: {address} "
                + (
                    "needs keys: write keys: keys, and make that folder with 'rsc-swarm keys keys --fleet FILE'"
                    if protocol in SECRET
                    else "is plain text, and the fleet has keys; write quic/ instead"
                )
            )
        if host_of(address) in ("0.0.0.0", "::"):
            raise FleetError(
                f"{name}: {address} is no machine that others could reach; write the address of its own"
            )
        if protocol not in SECRET and not fleet.radio.plain_text and not is_here(host_of(address)):
            raise FleetError(
                f"{name}: {address} is plain text, which everybody on the way can read and forge: use keys and quic/, "
                "or radio: {plain_text: true} on a network of your own"
            )


def _check_one_network(plan: Plan) -> None:
    addresses = plan.fleet.addresses
    away = next((name for name, address in addresses.items() if not is_here(host_of(address))), None)
    for name, address in addresses.items():
        if away and is_here(host_of(address)):
            raise FleetError(
                f"{name}: {address} is reached on its own machine alone, and {away} is on another: {addresses[away]}; "
                "give it an address of their network"
            )


def _check_distances(plan: Plan) -> None:
    limit = plan.limit_m
    slots = plan.slots_at(0)
    for what, points in (("start_m: drones", plan.starts), ("scale: slots", slots)):
        for (i, one), (j, other) in combinations(enumerate(points), 2):
            if math.dist(one, other) < limit:
                raise FleetError(
                    f"{what} {i} and {j} are {math.dist(one, other):.2f} m apart, and {limit:.2f} m is a collision; "
                    "move them apart"
                )
    for index, (x, y, radius) in enumerate((*plan.obstacles, *plan.virtual_obstacles)):
        for drone, start in enumerate(plan.starts):
            if math.dist(start, (x, y)) - radius < limit:
                raise FleetError(
                    f"start_m: drone {drone} stands {math.dist(start, (x, y)) - radius:.2f} m from obstacle {index}, and "
                    f"{limit:.2f} m is a collision; move it away"
                )


def _check_fence(plan: Plan) -> None:
    fence, margin = plan.fleet.fence, plan.fleet.guard.fence_margin_m
    way = [*plan.starts, *plan.slots_at(0), *plan.slots_at(plan.ticks)]
    heights = [plan.height(slot) for slot in range(plan.mission.agents)]
    xs, ys = [x for x, _ in way], [y for _, y in way]
    for name, (low, high), (needs_low, needs_high) in (
        ("x_m", fence.x_m, (min(xs) - margin, max(xs) + margin)),
        ("y_m", fence.y_m, (min(ys) - margin, max(ys) + margin)),
        ("z_m", fence.z_m, (0.0, max(heights) + margin)),  # nobody is to keep away from the floor
    ):
        least = f"[{math.floor(100 * needs_low) / 100:g}, {math.ceil(100 * needs_high) / 100:g}]"
        if needs_low < low - 1e-9 or needs_high > high + 1e-9:
            raise FleetError(
                f"fence.{name}: [{low:g}, {high:g}] is smaller than the way; give at least {least}, or another origin_m, "
                "yaw_deg or scale"
            )
        if max(needs_low - low, high - needs_high) > _FAR_M:
            raise FleetError(
                f"fence.{name}: [{low:g}, {high:g}] reaches more than {_FAR_M:g} m beyond the way, and keeps nobody in; "
                f"give it in metres, at least {least}"
            )


def _check_world(plan: Plan) -> None:
    """Drones land when their own goal line is behind them, and take what is close together for one obstacle."""
    virtual = plan.virtual_obstacles
    if len(plan.obstacles) + len(virtual) > MAX_OBSTACLES:
        raise FleetError(f"world.obstacles_m: with those of the room at most {MAX_OBSTACLES}; leave some out")
    for index, disc in enumerate(virtual):
        x, _, radius = plan.in_mission(disc)
        if x + radius > plan.goal_x_m:
            raise FleetError(
                f"world.obstacles_m.{index}: it ends at x = {x + radius:.1f} m of the mission, beyond the goal line at "
                f"{plan.goal_x_m:.1f} m; move it back"
            )
        for other in (*plan.obstacles, *virtual[:index]):
            if math.dist(disc[:2], other[:2]) <= ONE_OBSTACLE_M:
                raise FleetError(
                    f"world.obstacles_m.{index}: its centre is {math.dist(disc[:2], other[:2]):.2f} m from another's, and "
                    f"drones take two within {ONE_OBSTACLE_M:g} m for one; move it away"
                )


_CHECKS: tuple[Callable[[Plan], None], ...] = (
    _check_addresses,
    _check_distances,
    _check_fence,
    _check_world,
    _check_one_network,
)
