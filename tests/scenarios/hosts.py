"""Fleets on four machines with a bad network between them (tests.scenarios.wires): the operator on one, two drones on each other.

python -m tests.scenarios.hosts --flights 20 --loss 0.1 --parted 3
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from agent.air.pilot import Phase
from agent.air.trouble import Trouble
from protocols.fleet.plan import Plan
from rsc_swarm.air.alone import fly_drone, load
from rsc_swarm.air.plans import keys_of, read_plan
from rsc_swarm.air.station import Script, Station, read_script
from rsc_swarm.air.tower import watch
from rsc_swarm.flight.key_files import make_fleet_key_files
from tests.scenarios.fleets import Fleet
from tests.scenarios.wires import Rules, Wires, address
from world.server.credentials import FleetHosts

_DRONES, _EACH = 6, 2
_GROUND = 0  # the machine of the operator


@dataclass(frozen=True)
class Flown:
    """What the operator says of one flight. held: drones that did not fly the mission to its end."""

    success: bool
    closest_m: float
    slot_error_m: float
    held: int


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


def fly(folder: Path, loss: float, parted_s: float) -> Flown:
    """One flight with so much loss, in which machine 2 is cut off for so long, 1 s after `go`."""
    fleet = fleet_on_hosts(folder)
    plan, out = read_plan(fleet.file), folder / "flown"
    keys = keys_of(fleet.file, plan)
    load(plan)
    with Wires(4) as wires:
        wires.rule(Rules(loss=loss))
        for me in range(_DRONES):
            wires.start(machine_of(me), _drone(plan, me, keys, folder))
        operator = wires.start(_GROUND, _operator(plan, keys, folder, out))
        if parted_s:
            _await(folder / "going", 90.0)
            time.sleep(1.0)
            wires.rule(Rules(loss=loss, cut=(2,)))
            time.sleep(parted_s)
            wires.rule(Rules(loss=loss))
        wires.wait(operator)
    success, closest, slot_error, held = out.read_text().split()
    return Flown(success == "True", float(closest), float(slot_error), int(held))


def _await(file: Path, seconds: float) -> None:
    deadline = time.monotonic() + seconds
    while not file.exists() and time.monotonic() < deadline:
        time.sleep(0.05)


def _drone(plan: Plan, me: int, keys: Path | None, folder: Path) -> Callable[[], int]:
    def run() -> int:
        fly_drone(plan, me, keys, None, folder / f"drone-{me}", Trouble())
        return 0

    return run


def _operator(plan: Plan, keys: Path | None, folder: Path, out: Path) -> Callable[[], int]:
    def attend(station: Station, utc_us: int, now: float) -> bool:
        if Phase.FLY in station.phases(now).values():
            (folder / "going").touch()
        return True

    def run() -> int:
        script = Script(read_script("preflight,arm,takeoff,go", plan), print)
        station, judged, _ = watch(plan, keys, attend, script, None)
        held = {drone for _, drone, phase, _ in station.events if phase == Phase.HOLD}
        success = judged is not None and not judged.failure and not script.failed
        closest, slot_error = (judged.closest_m, judged.slot_error_m or 0.0) if judged else (0.0, 0.0)
        out.write_text(f"{success} {closest} {slot_error} {len(held)}")
        return 0

    return run


def main() -> None:
    options = argparse.ArgumentParser()
    options.add_argument("--flights", type=int, default=1)
    options.add_argument("--loss", type=float, default=0.0)
    options.add_argument("--parted", type=float, default=0.0)
    chosen = options.parse_args()
    flown = []
    for _ in range(chosen.flights):
        with tempfile.TemporaryDirectory() as folder:
            flown.append(fly(Path(folder), chosen.loss, chosen.parted))
            print(flown[-1], flush=True)
    good = sum(each.success for each in flown)
    print(f"{good} of {len(flown)} succeed; closest {min(each.closest_m for each in flown):.2f} m")


if __name__ == "__main__":
    main()
