"""All drones of a fleet on one machine: forked from this process once it has all loaded, watched, asked to leave with it."""

import signal
import sys
import time
from pathlib import Path

from agent.air.trouble import Trouble
from protocols.errors import ExitCode
from protocols.fleet.plan import Plan
from protocols.wire.keys import login_file
from rsc_swarm.air.alone import fly_drone, load
from rsc_swarm.air.folder import check_folder
from rsc_swarm.air.radios import be_host, radios_of
from rsc_swarm.flight.processes import Supervisor
from rsc_swarm.machine.leaving import leave_when_asked

_LOOK_S = 0.1
_LAND_S = 60.0


def fly_all(plan: Plan, keys: Path | None, run_dir: Path | None, troubles: dict[int, Trouble]) -> ExitCode:
    """Fly every drone of ``plan`` in a process of its own until all have left, or until asked to leave; then all land.

    A drone that is gone is told of, and not started again: its vehicle is landing by its own failsafe. If this process is
    killed, the drones land too.
    """
    if run_dir:
        check_folder(run_dir)
    radios = radios_of(plan)
    for doubt in (doubt for radio in radios for doubt in radio.doubts):
        print(f"rsc-swarm: {doubt}", file=sys.stderr, flush=True)
    load(plan)
    worst = ExitCode.SUCCEEDED
    with leave_when_asked() as leave, Supervisor() as drones:
        for radio in radios:
            drones.start(f"radio host {radio.dongle}", be_host, radio, at_launcher_death=signal.SIGTERM)
        for me in range(plan.mission.agents):
            folder = run_dir / f"drone-{me}" if run_dir else None
            key_file = keys / login_file(me) if keys else None
            drones.start(
                f"drone {me}", fly_drone, plan, me, key_file, None, folder, troubles.get(me, Trouble()),
                at_launcher_death=signal.SIGTERM,
            )  # fmt: skip
        while drones.running and not leave.asked:
            time.sleep(_LOOK_S)
            for gone in drones.poll():
                print(
                    f"rsc-swarm: {gone}; its vehicle is left to its own failsafe", file=sys.stderr, flush=True
                )
                worst = ExitCode.BROKEN
        drones.stop(_LAND_S)
    return ExitCode.INTERRUPTED if leave.asked else worst
