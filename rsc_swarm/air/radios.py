"""The radio hosts of a fleet: which dongle leads which Crazyflies, and how the program of one is started.

That program is `rsc_swarm.radiohost`, a process of its own: it alone knows cflib, which is under the GPL.
"""

import json
import os
import sys
from dataclasses import asdict
from typing import NamedTuple, NoReturn

from agent.air.listening import check_free
from protocols.fleet.document import DroneSpec, FleetError, PositionSource
from protocols.fleet.plan import Plan
from protocols.keeper import Limits
from protocols.wire.endpoints import stays_here
from protocols.wire.vehicles import dongle_of, host_endpoint
from rsc_swarm.machine.priority import go_first

KIND = "crazyflie:"
MOST_CRAZYFLIES = 3  # that one dongle can lead at 50 Hz


class Radio(NamedTuple):
    """A dongle. drones: number and address (of cflib) of each that it leads. limits: of all. positions: who tells where they
    are; None: nobody.
    """

    dongle: int
    endpoint: str
    drones: tuple[tuple[int, str], ...]
    swarm: str
    limits: Limits
    positions: PositionSource | None = None

    @property
    def settings(self) -> str:
        """As ``python -m rsc_swarm.radiohost`` wants them."""
        limits = asdict(self.limits)
        charges = [{"drone": drone, "uri": uri, "limits": limits} for drone, uri in self.drones]
        settings = {"swarm": self.swarm, "endpoint": self.endpoint, "charges": charges}
        if self.positions:
            settings["positions"] = self.positions.endpoint
            for charge in charges:
                charge["position_key"] = self.positions.key.replace("{number}", str(charge["drone"]))
        return json.dumps(settings)

    @property
    def doubts(self) -> list[str]:
        """What may go wrong with it."""
        sharing = [drone for drone, uri in self.drones if uri.startswith("radio://")]
        if len(sharing) <= MOST_CRAZYFLIES:
            return []
        return [
            f"dongle {self.dongle} leads {len(sharing)} Crazyflies: more than {MOST_CRAZYFLIES} are led badly by one; "
            "share them out among more"
        ]


def radios_of(plan: Plan) -> tuple[Radio, ...]:
    """All that a fleet needs, by their dongles.

    Raises:
        FleetError: a Crazyflie has an address that is none, or two dongles have one endpoint.
    """
    led: dict[tuple[int, str], list[tuple[int, str]]] = {}
    for spec in plan.fleet.drones:
        if spec.body.startswith(KIND):
            uri = spec.body.removeprefix(KIND)
            dongle = _dongle(spec, uri)
            endpoint = spec.options.get("host", host_endpoint(dongle))
            led.setdefault((dongle, endpoint), []).append((spec.number, uri))
    endpoints = [endpoint for _, endpoint in led]
    for dongle, endpoint in led:
        if endpoints.count(endpoint) > 1:
            raise FleetError(
                f"drones: host: {endpoint} is that of dongle {dongle} and of another; give each its own"
            )
    positions = plan.fleet.positions
    if positions and not led:
        raise FleetError(
            "positions: no drone of this fleet is a Crazyflie, and autopilots are told where they are by a program of yours; "
            "leave it out"
        )
    if positions and not plan.fleet.radio.plain_text and not stays_here(positions.endpoint):
        raise FleetError(
            f"positions.endpoint: {positions.endpoint} is plain text or of a stranger, and who changes it on the way flies the "
            "Crazyflies astray: let the bridge run on this machine, or write radio: {plain_text: true} on a network of your own"
        )
    guard = plan.fleet.guard
    limits = Limits(guard.setpoint_hold_s, guard.setpoint_land_s, braking_mps2=0.5 * plan.acceleration_mps2)
    return tuple(
        Radio(dongle, endpoint, tuple(drones), plan.mission.swarm, limits, positions)
        for (dongle, endpoint), drones in sorted(led.items())
    )


def radio_of(plan: Plan, dongle: int | None) -> Radio:
    """The one of a dongle; None: of the only one there is.

    Raises:
        FleetError: there is none, or there are several; or as `radios_of`.
    """
    radios = [radio for radio in radios_of(plan) if dongle in (None, radio.dongle)]
    if len(radios) == 1:
        return radios[0]
    if radios:
        numbers = ", ".join(str(radio.dongle) for radio in radios)
        raise FleetError(f"--dongle: this fleet has several ({numbers}): say which")
    which = "" if dongle is None else f" on dongle {dongle}"
    raise FleetError(
        f"no drone of this fleet is a Crazyflie{which}: one has body: crazyflie:radio://0/80/2M/E7E7E7E701"
    )


def check_addresses_free(plan: Plan) -> None:
    """Raises protocols.wire.keys.LinkError if an address of a fleet on this machine is taken, by another fleet say."""
    drones = map(plan.fleet.address, range(plan.mission.agents))
    for address in (*drones, *(radio.endpoint for radio in radios_of(plan))):
        check_free(address)


def be_host(radio: Radio) -> NoReturn:
    """Become the program of a radio host: one that goes first, for a Crazyflie that is told nothing for 2 s falls."""
    go_first()
    os.execv(sys.executable, [sys.executable, "-m", "rsc_swarm.radiohost", radio.settings])


def _dongle(spec: DroneSpec, uri: str) -> int:
    try:
        named = dongle_of(uri)
    except ValueError as error:
        raise FleetError(f"drones: {spec.number}: body: {error}") from None
    if spec.dongle is None:
        return named
    if uri.startswith("radio://") and spec.dongle != named and "host" not in spec.options:
        raise FleetError(
            f"drones.{spec.number}.dongle: {spec.dongle}, and {uri} is reached by dongle {named} of this machine; leave dongle "
            "out, or name the host of another machine in options: {host: ...}"
        )
    return spec.dongle
