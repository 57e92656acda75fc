"""How often a fleet flies the lab mission on the air: take-off, a triangle past the obstacle, landing.

python -m tests.scenarios.missions crazyflie --flights 20     six Crazyflies, fakes behind cflib in two radio hosts
python -m tests.scenarios.missions mavlink --flights 20       six autopilots, fakes behind pymavlink
python -m tests.scenarios.missions hosts --flights 20         six points on four machines, 10 % loss, one cut off for 3 s (root)

Where drones were is what each said of itself, tick by tick; distances are of the room.
"""

import argparse
import json
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from protocols.fleet.plan import Plan
from rsc_swarm.air.judged import Judged, judged
from rsc_swarm.air.plans import read_plan
from rsc_swarm.machine.priority import go_first
from tests.scenarios import hosts
from tests.scenarios.fleets import Fleet
from tests.scenarios.vehicles import KINDS
from world.outlets.trajectory import Trajectory

_LOSS, _PARTED_S = 0.1, 3.0


@dataclass(frozen=True)
class Flown:
    """operator: whether the operator saw a success. landed: drones. missed: share of ticks. why: what came between."""

    operator: bool
    truth: Judged | None
    landed: int
    missed: float
    why: tuple[str, ...]


def true_path(folder: Path, drones: int) -> Trajectory:
    """Where each drone says itself that it was."""
    paths = [Trajectory.load(folder / f"drone-{me}" / "1" / "trajectory.npz") for me in range(drones)]
    rows = min(len(path.positions) for path in paths)

    def own(name: str) -> np.ndarray:
        return np.stack([getattr(path, name)[:rows, me] for me, path in enumerate(paths)], axis=1)

    one = paths[0]
    return Trajectory(
        own("positions"), own("velocities"), own("slots"), own("flying"), one.obstacles, one.goal_x, one.tick_s
    )  # fmt: skip


def told(folder: Path, plan: Plan, operator: bool) -> Flown:
    """What came of a flight that drones kept in ``folder``."""
    drones = plan.mission.agents
    reports = [json.loads(file.read_text()) for file in sorted(folder.glob("drone-*/1/report.json"))]
    events = [event for report in reports for event in report["events"]]
    landed = sum(event["phase"] == "ground" and event["why"] == "landed" for event in events)
    why = [
        f"drone {event['drone']}: {event['phase']} ({event['why']})"
        for event in events
        if event["phase"] in ("hold", "dead")
    ]
    truth = judged(plan, true_path(folder, drones)) if len(reports) == drones else None
    missed = sum(report["missed"] for report in reports) / (drones * plan.ticks)
    return Flown(operator, truth, landed, missed, tuple(why))


def fly(kind: str, folder: Path) -> tuple[Plan, Flown]:
    """One flight."""
    if kind == "hosts":
        fleet = hosts.fleet_on_hosts(folder)
        plan = read_plan(fleet.file)
        return plan, told(folder, plan, hosts.fly(fleet, plan, _LOSS, _PARTED_S))
    with KINDS[kind]() as vehicles:
        fleet = Fleet(folder, drones=vehicles.drones)
        plan = read_plan(fleet.file)
        with fleet.in_the_air():
            success = fleet.operator("preflight,arm,takeoff,go").wait(250) == 0
        return plan, told(folder, plan, success)


def succeeded(plan: Plan, flown: Flown) -> bool:
    """In formation, without a collision, seen so by the operator, and all landed."""
    return (
        flown.operator
        and flown.truth is not None
        and flown.truth.failure is None
        and flown.landed == plan.mission.agents
    )


def flights(kind: str, count: int) -> Iterator[tuple[Plan, Flown]]:
    for _ in range(count):
        with tempfile.TemporaryDirectory() as folder:
            yield fly(kind, Path(folder))


def main() -> None:
    options = argparse.ArgumentParser()
    options.add_argument("kind", choices=[*KINDS, "hosts"])
    options.add_argument("--flights", type=int, default=1)
    options.add_argument("--each", action="store_true", help="tell of each")
    chosen = options.parse_args()
    go_first()  # for fakes are what would not wait for this machine
    good, closest, slot, missed, busy = 0, [], [], [], []
    for plan, flown in flights(chosen.kind, chosen.flights):
        good += succeeded(plan, flown)
        busy.append(os.getloadavg()[0])
        missed.append(flown.missed)
        if flown.truth:
            closest.append(flown.truth.closest_m)
            slot.append(flown.truth.slot_error_m or 0.0)
        if chosen.each:
            print(f"{succeeded(plan, flown)} {flown} load {busy[-1]:.1f}", flush=True)
    print(
        f"{chosen.kind}: {good} of {chosen.flights} succeed; closest {min(closest):.2f} m (limit {plan.limit_m:.2f}), worst slot "
        f"error {max(slot):.2f} m, ticks missed {100 * np.mean(missed):.3f} %, load {min(busy):.0f} to {max(busy):.0f}"
    )


if __name__ == "__main__":
    main()
