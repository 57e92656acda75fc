"""Whether the bodies that a fleet file names can be led as it says: what would mean nothing to a body is refused, not ignored."""

import re
from itertools import combinations

from agent.air.vehicle import Failsafe, Rig, VehicleAddressError, make_vehicle
from protocols.fleet.document import DroneSpec, FleetError, host_of
from protocols.fleet.plan import Plan
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


def check_bodies(plan: Plan) -> None:
    """Raises FleetError: a body is none, is given what means nothing to it, or two drones lead the same; one line."""
    for spec in plan.fleet.drones:
        try:
            make_vehicle(spec.body, rig_of(plan, spec.number))
        except VehicleAddressError as error:
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
    # The same port of another computer is another.
    return (
        None if kind == "point" else (host_of(plan.fleet.address(spec.number)), kind, where.partition("?")[0])
    )


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
