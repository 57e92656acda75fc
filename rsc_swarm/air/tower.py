"""The operator's process: hears every drone, says the orders, keeps the flight. A thin shell around Station."""

import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

from agent.air.clock import Utc
from agent.air.peers import OPERATOR, AirLink, end_of
from protocols.errors import SwarmError
from protocols.fleet.document import host_of
from protocols.fleet.plan import Plan
from protocols.wire.operator import Order
from rsc_swarm.air.folder import check_folder, event_of, keep, next_folder
from rsc_swarm.air.judged import Judged, judged, path_of
from rsc_swarm.air.station import Script, Station
from rsc_swarm.flight.key_files import read_operator_login
from rsc_swarm.machine.leaving import leave_when_asked
from rsc_swarm.machine.priority import go_first

_LOOK_S = 0.02
_SAY_S = 0.1
_DOWN_S = 40.0

Attend = Callable[[Station, int, float], bool]  #: UTC [us], s -> whether to go on


def watch(
    plan: Plan, keys: Path | None, attend: Attend, script: Script | None, run_dir: Path | None
) -> tuple[Station, Judged | None, bool]:
    """Be the operator: until ``attend``, which is called 50 times a second, wants no more, the script is over, or one is asked to
    leave; then an abort brings all down first.

    Args:
        keys: the folder of keys, if the fleet has some.

    Returns:
        The station, how the flight went if there was one, and whether it was asked to leave.

    Raises:
        protocols.wire.keys.LinkError: the operator's address cannot be listened at.
        rsc_swarm.flight.run_dir.RunDirError: nothing can be kept in ``run_dir``.
        rsc_swarm.flight.key_files.KeyFileError: of the operator's keys.
    """
    if run_dir:
        check_folder(run_dir)
    go_first()
    clock = Utc()
    station = Station(plan, version("rsc-swarm"), clock.us())
    swarm, address = plan.mission.swarm, plan.fleet.ground_address
    own = read_operator_login(keys, swarm, host_of(address)).certificates if keys else None
    with (
        leave_when_asked() as leave,
        AirLink(swarm, end_of(plan.fleet, OPERATOR), own, plan.mission.agents, clock) as link,
    ):
        said_at = leaving_at = 0.0
        while True:
            now, utc_us = time.monotonic(), clock.us()
            for said in link.hear():
                station.hear(said, now)
            if script:
                script.advance(station, utc_us, now)
            going_on = attend(station, utc_us, now) and not leave.asked and not (script and script.over)
            if not going_on and not leaving_at:
                leaving_at, station.leaving = now, True
                if station.in_flight(now):
                    station.order(Order.ABORT, utc_us, now)
            if not station.in_flight(now):
                clock.set()  # somebody may have set this machine's
            if now - said_at >= _SAY_S:
                said_at = now
                link.say("word", station.word(utc_us))
            station.record(utc_us, now)
            if leaving_at and (not station.in_flight(now) or now - leaving_at > _DOWN_S):
                break
            time.sleep(_LOOK_S)
    outcome = None
    if station.log.rows:
        events = [event_of(drone, utc_s, phase, why) for utc_s, drone, phase, why in station.events]
        missed = {drone: account.missed for drone, account in sorted(station.accounts.items())}
        try:
            if run_dir:
                outcome = keep(next_folder(run_dir), plan, station.log, events, missed=missed)
        except SwarmError as error:  # it is told all the same
            print(f"rsc-swarm: this flight is not kept: {error}", file=sys.stderr)
        if outcome is None:
            outcome = judged(plan, path_of(plan, station.log))
    return station, outcome, leave.asked
