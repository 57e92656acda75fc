"""Fleets in real processes with Zenoh between them and no world."""

import json
import os
import signal
from pathlib import Path

import numpy as np

from rsc_swarm.air.plans import read_plan
from rsc_swarm.flight.run_dir import RunDir
from tests.scenarios.fleets import Fleet, drone_processes
from world.outlets.trajectory import Trajectory


def true_paths(folder: Path, drones: int) -> np.ndarray:
    """(T, N, 2) where each drone says itself that it was, m of the mission."""
    paths = [
        Trajectory.load(folder / f"drone-{me}" / "1" / "trajectory.npz").positions[:, me]
        for me in range(drones)
    ]
    rows = min(map(len, paths))
    return np.stack([path[:rows] for path in paths], axis=1)


def test_six_points_take_off_fly_past_the_obstacle_in_a_triangle_and_land(tmp_path: Path) -> None:
    fleet = Fleet(tmp_path, keys="keys")
    fleet.make_keys()
    plan = read_plan(fleet.file)
    with fleet.in_the_air():
        operator = fleet.operator("preflight,arm,takeoff,go")
        assert operator.wait(200) == 0, fleet.told + fleet.log
    assert "SUCCESS" in fleet.told
    assert fleet.log.count("ground (landed)") == 6
    paths = true_paths(tmp_path, 6)
    gaps = np.linalg.norm(paths[:, :, None] - paths[:, None], axis=3) + 99 * np.eye(6)
    assert gaps.min() >= plan.mission.limits.collision_m
    report = json.loads((tmp_path / "ground" / "1" / "report.json").read_text())
    assert report["slot_error_m"] <= 0.15
    for folder in (tmp_path / "ground" / "1", tmp_path / "drone-3" / "1"):
        RunDir(folder).check()  # `plot` draws it


def test_nothing_flies_before_preflight_is_green(tmp_path: Path) -> None:
    """The drones were given another fleet file than the operator."""
    fleet = Fleet(tmp_path)
    (tmp_path / "other").mkdir()
    other = Fleet(tmp_path / "other", radio={"port": fleet.port}, height_m=0.9)
    with other.in_the_air():
        other.await_said("ready after", 6, 120)
        operator = fleet.operator("preflight,arm,takeoff,go", preflight_s=5.0)
        assert operator.wait(100) == 1
    assert "it has another fleet file" in fleet.told
    assert "armed" not in other.log


def test_a_killed_drone_and_a_killed_operator_bring_down_nobody_else_but_by_landing(tmp_path: Path) -> None:
    """A drone's process dies in the mission, and a moment later the operator's: the others hold, and land."""
    fleet = Fleet(tmp_path, "hall.yaml", guard={"operator_hold_s": 2, "operator_land_s": 4})
    with fleet.in_the_air() as air:
        operator = fleet.operator("preflight,arm,takeoff,go")
        fleet.await_said("fly (start)", 6, 120)
        os.kill(drone_processes(air)[3], signal.SIGKILL)
        fleet.await_said("drone 3 (process", 1, 20)
        operator.kill()
        fleet.await_said("hold (operator not heard", 5, 30)
        fleet.await_said("ground (landed)", 5, 60)
        assert air.poll() is None
    operator.wait(60)
    assert fleet.log.count("land (") == 5
    assert "dead" not in fleet.log
