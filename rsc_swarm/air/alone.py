"""One drone on the air, as on its companion computer: everything it needs is opened, then it is flown until asked to leave."""

import os
import sys
from contextlib import closing
from importlib.metadata import version
from pathlib import Path

from agent.air.body import RoomBody
from agent.air.clock import Utc
from agent.air.contacts import Contacts
from agent.air.drone import AirDrone
from agent.air.flying import fly
from agent.air.listening import check_free
from agent.air.obstacles import Obstacles
from agent.air.peers import AirLink, end_of, name_of
from agent.air.pilot import Phase
from agent.air.reach import reach_of
from agent.air.trouble import Trouble
from agent.air.vehicle import Vehicle
from agent.process import seals_of
from protocols.errors import SwarmError
from protocols.fleet.document import FleetError, host_of
from protocols.fleet.plan import Plan
from rsc_swarm.air.bodies import vehicle_of
from rsc_swarm.air.folder import check_folder, event_of, keep, next_folder
from rsc_swarm.air.judged import rehearse_judging
from rsc_swarm.flight.key_files import read_fleet_login
from rsc_swarm.flight.warm_up import warm_up_drone
from rsc_swarm.machine.census import age_s
from rsc_swarm.machine.leaving import leave_when_asked
from rsc_swarm.machine.limits import make_room
from rsc_swarm.machine.priority import go_first
from rsc_swarm.machine.service import Service

_OPEN_S = 60.0  # the first time a radio host reads long tables from its Crazyflies


def fly_drone(
    plan: Plan, me: int, key_file: Path | None, body: str | None, run_dir: Path | None, trouble: Trouble
) -> None:
    """Be drone ``me`` of ``plan``, in the vehicle at ``body`` (None: as the fleet file has it), until asked to leave.

    Args:
        key_file: its own keys, if the fleet has some.

    Raises:
        FleetError: there is no such drone, or its body may not be reached so. rsc_swarm.flight.run_dir.RunDirError: nothing
            can be kept in ``run_dir``. agent.air.vehicle.VehicleError: its vehicle is not
            there, or no longer.
        protocols.wire.keys.LinkError: its address cannot be listened at.
        rsc_swarm.flight.key_files.KeyFileError: of its keys. agent.policy.PolicyError: of its policy.
    """
    if me >= plan.mission.agents:
        raise FleetError(f"--agent {me}: the fleet's drones are 0 to {plan.mission.agents - 1}")
    vehicle = vehicle_of(plan, me, body)
    if run_dir:
        check_folder(run_dir)
    load(plan)
    # Before the vehicle hears anything: it may be in the air with another of this drone's processes.
    check_free(plan.fleet.address(me))
    vehicle.open(_OPEN_S)
    with closing(vehicle):
        _fly(plan, me, vehicle, key_file, run_dir, trouble)


def _fly(
    plan: Plan, me: int, vehicle: Vehicle, key_file: Path | None, run_dir: Path | None, trouble: Trouble
) -> None:
    fleet = plan.fleet
    address, service = fleet.address(me), Service()
    login = read_fleet_login(key_file, plan.mission.swarm, me, host_of(address)) if key_file else None
    seals = login.seals if login else None
    drone = AirDrone(
        plan, me, vehicle, version("rsc-swarm"), lambda flight: seals_of(seals, plan.mission.agents, flight)
    )

    def tell(phase: Phase, reasons: tuple[str, ...]) -> None:
        _say(me, f"{phase} ({'; '.join(reasons)})")
        if phase in (Phase.GROUND, Phase.DEAD) and drone.log.rows and run_dir:
            events = [event_of(me, *event) for event in drone.events]
            try:
                keep(next_folder(run_dir), plan, drone.log, events, drone=me, missed=drone.missed)
            except SwarmError as error:  # no reason to leave the air
                _say(me, f"this flight is not kept: {error}")

    go_first()
    with leave_when_asked() as leave:
        certificates, clock = login.certificates if login else None, Utc()
        end, agents = end_of(fleet, name_of(me)), plan.mission.agents
        with AirLink(plan.mission.swarm, end, certificates, agents, clock) as link:
            _say(me, f"ready after {age_s():.2f} s at {address}, process {os.getpid()}")
            service.ready(f"drone {me} at {address}")
            fly(drone, link, lambda: service.alive(leave.asked), tell, trouble, clock)


def load(plan: Plan) -> None:
    """Load all that a drone of ``plan`` needs in the air and after it."""
    make_room(plan.mission.agents)
    rehearse_judging(plan)
    warm_up_drone(plan.mission)
    RoomBody(plan, 0, Contacts(0, reach_of(plan)), Obstacles(()), lags=False).fly(0.0, 0.0)


def _say(me: int, text: str) -> None:
    # In one piece: many drones write to one terminal.
    print(f"drone {me}: {text}\n", end="", file=sys.stderr, flush=True)
