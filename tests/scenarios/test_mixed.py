"""Mixed reality in real processes: six points fly by the radio of a world, which is a process of its own."""

import json
import subprocess
import sys
from pathlib import Path

from rsc_swarm.flight.run_dir import RunDir
from tests.scenarios.fleets import Fleet


def test_six_points_fly_by_a_bad_radio_around_an_obstacle_that_nobody_can_touch(tmp_path: Path) -> None:
    """With keys, and faults from the command line; the world leaves a run directory as a launch does."""
    fleet = Fleet(tmp_path, keys="keys", world={"obstacles_m": [[-1.6, -0.35, 0.12]], "noise_m": 0.02})
    fleet.make_keys()
    folder = tmp_path / "world"
    words = ["--burst", "0.2", "--set", "faults=[{at_s: 2, kind: loss, loss: 0.1}]", "--run-dir", str(folder)]
    command = [
        sys.executable,
        "-m",
        "rsc_swarm",
        "world",
        "--bodies",
        "external",
        "--fleet",
        str(fleet.file),
        *words,
    ]
    with (
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as world,
        fleet.in_the_air(),
    ):
        assert fleet.operator("preflight,arm,takeoff,go").wait(200) == 0, fleet.told + fleet.log
        told, _ = world.communicate(timeout=60)
    assert world.returncode == 0, told
    RunDir(folder).check()  # `plot` draws it
    report = json.loads((folder / "report.json").read_text())
    assert report["success"], report["detail"]
    assert report["mode"] == "world"
    assert report["frames"]["dropped"]["burst"] > 0
    assert report["frames"]["dropped"]["loss"] > 0
    assert len(report["mission"]["obstacles"]["discs"]) == 2
    assert report["again"].startswith("rsc-swarm world --burst 0.2")
