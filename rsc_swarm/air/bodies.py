"""Whether the bodies that a fleet file names can be led as it says: what would mean nothing to a body is refused, not ignored."""

import re
from collections.abc import Mapping
from itertools import combinations

from agent.air.mavlink import parse_address
from agent.air.vehicle import Failsafe, Rig, Vehicle, VehicleAddressError, make_vehicle
from protocols.fleet.document import DroneSpec, FleetError, host_of
from protocols.fleet.plan import Plan
from protocols.wire.endpoints import is_here, is_secret, stays_here
from rsc_swarm.air.radios import radios_of

_AUTOPILOT = "mavlink:"
_ON_AIR = re.compile(r"radio://\d+/(?P<channel>\d+)/(?P<rate>\w+)(?:/(?P<address>\w+))?")
_USUAL = "E7E7E7E7E7"  # of a Crazyflie that was given no other


def rig_of(plan: Plan, me: int) -> Rig:
    """What the vehicle of drone ``me`` is told."""
    guard, spec = plan.fleet.guard, plan.fleet.drones[me]
    return Rig(
        me, (*plan.starts[me], 0.0), plan.speed_mps, plan.acceleration_mps2,
        Failsafe(guard.setpoint_hold_s, guard.setpoint_land_s), spec.options, spec.dongle, plan.mission.swarm,
    )  # fmt: skip


def vehicle_of(plan: Plan, me: int, body: str | None = None) -> Vehicle:
    """The vehicle of drone ``me``, at ``body`` or where the fleet file has it. It is not opened.

    Raises:
        VehicleAddressError: as make_vehicle. FleetError: plain text would leave this machine, and nobody said that it may.
    """
    rig = rig_of(plan, me)
    if body is None:
        body = plan.fleet.drones[me].body
    vehicle = make_vehicle(body, rig)
    if not plan.fleet.radio.plain_text:
        _refuse_plain_text(body, rig.options)
    return vehicle


def _refuse_plain_text(body: str, options: Mapping[str, str]) -> None:
    kind, _, where = body.partition(":")
    if host := options.get("host"):
        if is_secret(host):
            raise FleetError(f"options: host: a radio host has no keys; write tcp/{host.partition('/')[2]}")
        if not stays_here(host):
            raise FleetError(
                f"options: host: {host} is plain text, and who changes it on the way flies the Crazyflies: let their radio host "
                "run on this machine, or write radio: {plain_text: true} on a network of your own"
            )
    elif kind == "mavlink":
        way, *place = parse_address(where).connection.split(":")
        if way != "serial" and not is_here(place[0]):
            raise FleetError(
                f"{body} is plain text, and who changes it on the way flies the vehicle: let it come by a wire or to an address "
                "of this machine (127.0.0.1), or write radio: {plain_text: true} on a network of your own"
            )


def check_bodies(plan: Plan) -> None:
    """Raises FleetError: a body is none, is given what means nothing to it, or two drones lead the same; one line."""
    for spec in plan.fleet.drones:
        try:
            vehicle_of(plan, spec.number)
        except (FleetError, VehicleAddressError) as error:
            raise FleetError(f"drones.{spec.number}: {error}") from None
    for one, other in combinations(plan.fleet.drones, 2):
        if (body := _led(plan, one)) and body == _led(plan, other):
            raise FleetError(
                f"drones: {one.number} and {other.number} have both the body {one.body}; give each its own"
            )
    radios_of(plan)
    _check_origins(plan)


def _led(plan: Plan, spec: DroneSpec) -> object:
    """Equal for two drones that lead one vehicle; None: a vehicle of its own."""
    kind, _, where = spec.body.partition(":")
    if match := _ON_AIR.fullmatch(where):
        address = int(match["address"] or _USUAL, 16)
        return int(match["channel"]), match["rate"], address
    if kind == "point":
        return None
    place = where.partition("?")[0]
    if place.startswith("udpin:"):  # two cannot listen to one port, by whatever name
        place = f"udpin:{place.rpartition(':')[2]}"
    # The same port of another computer is another.
    return host_of(plan.fleet.address(spec.number)), kind, place.replace("localhost", "127.0.0.1")


def _check_origins(plan: Plan) -> None:
    """Who knows its place by satellites and who does not, or by another origin, would meet where neither sees it."""
    autopilots = [spec for spec in plan.fleet.drones if spec.body.startswith(_AUTOPILOT)]
    for one, other in combinations(autopilots, 2):
        if _origin(one) != _origin(other):
            raise FleetError(
                f"drones: {one.number} and {other.number} have different options: {{origin: ...}}, and all need one frame; "
                "give all the same, or none where all are told their places in the room"
            )


def _origin(spec: DroneSpec) -> tuple[float, ...]:
    return tuple(float(part) for part in spec.options.get("origin", "").split(",") if part)
