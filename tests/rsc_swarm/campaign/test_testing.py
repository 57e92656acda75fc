"""Somebody else's controller is tested in ten lines, and a failure says what broke and how to fly it again."""

import subprocess
import sys
from pathlib import Path

from rsc_swarm.campaign.kept import all_kept, fly_kept

TEST = """
from hypothesis import given, settings
from rsc_swarm.testing import SETTINGS, missions

@settings(SETTINGS, max_examples=3, database=None, derandomize=True)
@given(mission=missions(agents=2, policy="{policy}", budget="none,restart=1", {fields}))
def test_it_survives(swarm, mission):
    swarm.survives(mission)
"""
POLICY = """
class Mine:
    def __init__(self, mission): pass
    def act(self, seen):
        return {wanted}
"""
BEGINNING = "fly_s=1.0, start={'radius_m': 0.0}"
TO_THE_GOAL = "goal_x_m=3, obstacles={'count': (0, 0)}, time_limit_s=5"


def result_of(folder: Path, wanted: str, fields: str) -> "subprocess.CompletedProcess[str]":
    """Of a test of a policy that wants this acceleration, on missions with these fields."""
    (folder / "mine.py").write_text(POLICY.format(wanted=wanted))
    (folder / "test_mine.py").write_text(TEST.format(policy=f"{folder}/mine.py:Mine", fields=fields))
    words = ["-q", "-p", "rsc_swarm.testing.plugin", "-p", "no:cacheprovider", "test_mine.py"]
    return subprocess.run(
        [sys.executable, "-m", "pytest", *words], cwd=folder, capture_output=True, text=True, timeout=250
    )


def test_one_that_keeps_all_passes(tmp_path: Path) -> None:
    done = result_of(
        tmp_path, "1.5 * seen.slot_error - 2.5 * (seen.velocity - seen.target_velocity)", BEGINNING
    )
    assert done.returncode == 0, done.stdout
    assert not (tmp_path / "swarm-failures").exists()


def test_one_that_raises_is_named_with_its_line(tmp_path: Path) -> None:
    done = result_of(tmp_path, "seen.nothing", BEGINNING)
    assert done.returncode == 1
    assert "mine.py:5 (act)" in done.stdout


def test_a_failure_is_told_with_the_command_that_flies_it_again(tmp_path: Path) -> None:
    done = result_of(tmp_path, "-9.0 * seen.velocity", TO_THE_GOAL)
    assert done.returncode == 1
    assert "not in formation in time: not in formation beyond the goal line within" in done.stdout
    assert (
        "Fly it again:  rsc-swarm simulate --mission swarm-failures/not-in-formation-in-time/" in done.stdout
    )
    assert "Traceback" not in done.stdout
    kept = all_kept(tmp_path / "swarm-failures")
    assert all(one.digest == fly_kept(one).digest for one in kept)
    assert kept[0].mission.faults == (), "Hypothesis shrinks to a mission without trouble"
