"""A fleet on four machines with a bad network between (tests.scenarios.wires): the operator on one, two drones on each of three.

python -m tests.scenarios.missions hosts flies some.
"""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from agent.air.pilot import Phase
from agent.air.trouble import Trouble
from protocols.fleet.plan import Plan
from protocols.wire.keys import login_file
from rsc_swarm.air.alone import fly_drone, load
from rsc_swarm.air.plans import keys_of
from rsc_swarm.air.station import Script, Station, read_script
from rsc_swarm.air.tower import watch
from rsc_swarm.flight.key_files import make_fleet_key_files
from tests.scenarios.fleets import Fleet
from tests.scenarios.wires import Rules, Wires, address
from world.server.credentials import FleetHosts

_DRONES, _EACH = 6, 2
_GROUND = 0  # the machine of the operator


def machine_of(drone: int) -> int:
    return 1 + drone // _EACH


def fleet_on_hosts(folder: Path) -> Fleet:
    """The example room, with keys, on four machines."""
    drones = [
        {"number": me, "address": f"quic/{address(machine_of(me))}:{7451 + me}"} for me in range(_DRONES)
    ]
    fleet = Fleet(folder, drones=drones, ground=f"quic/{address(_GROUND)}:7450", keys="keys")
    hosts = [address(machine_of(me)) for me in range(_DRONES)]
    make_fleet_key_files(folder / "keys", "rsc", FleetHosts(hosts, address(_GROUND)), 1, overwrite=False)
    return fleet


def fly(fleet: Fleet, plan: Plan, loss: float, parted_s: float) -> bool:
    """Fly with so much loss; machine 2 is cut off for so long, 1 s after `go`. Whether the operator saw a success.

    What each drone has kept of it lies in the folder of the fleet.
    """
    folder, keys = fleet.folder, keys_of(fleet.file, plan)
    load(plan)
    with Wires(4) as wires:
        wires.rule(Rules(loss=loss))
        for me in range(_DRONES):
            wires.start(machine_of(me), _drone(plan, me, keys, folder))
        operator = wires.start(_GROUND, _operator(plan, keys, folder))
        if parted_s:
            _await([folder / "going"], 90.0)
            time.sleep(1.0)
            wires.rule(Rules(loss=loss, cut=(2,)))
            time.sleep(parted_s)
            wires.rule(Rules(loss=loss))
        success = wires.wait(operator) == 0
        _await([folder / f"drone-{me}" / "1" / "report.json" for me in range(_DRONES)], 30.0)
    return success


def _await(files: Sequence[Path], seconds: float) -> None:
    deadline = time.monotonic() + seconds
    while not all(file.exists() for file in files) and time.monotonic() < deadline:
        time.sleep(0.05)


def _drone(plan: Plan, me: int, keys: Path | None, folder: Path) -> Callable[[], int]:
    def run() -> int:
        fly_drone(plan, me, keys / login_file(me) if keys else None, None, folder / f"drone-{me}", Trouble())
        return 0

    return run


def _operator(plan: Plan, keys: Path | None, folder: Path) -> Callable[[], int]:
    def attend(station: Station, utc_us: int, now: float) -> bool:
        if Phase.FLY in station.phases(now).values():
            (folder / "going").touch()
        return True

    def run() -> int:
        script = Script(read_script("preflight,arm,takeoff,go", plan), lambda _: None)
        _, judged, _ = watch(plan, keys, attend, script, folder / "ground")
        if script.failed:
            print(f"operator: {script.failed}")
        return int(judged is None or judged.failure is not None or script.failed is not None)

    return run
