"""A user's own policy in a file: the same flight in all commands, and the same line when it goes wrong in mid-flight."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
POLICY = """
from my_gains import GAIN


class Homing:
    def __init__(self, mission):
        pass

    def act(self, seen):
        if seen.tick == {raises_at}:
            raise KeyError("oops")
        return GAIN * seen.slot_error + 2.0 * (seen.target_velocity - seen.velocity)
"""


def swarm(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run the command in this folder."""
    return subprocess.run(
        [sys.executable, "-m", "rsc_swarm.cli.main", *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "my_gains.py").write_text("GAIN = 1.0\n")
    return tmp_path


def test_a_launch_by_a_file_is_the_flight_of_its_simulation(folder: Path) -> None:
    (folder / "homing.py").write_text(POLICY.format(raises_at=-1))
    digests = []
    for verb in ("simulate", "launch"):
        said = swarm(folder, verb, "-n", "3", "--policy", "homing.py:Homing", "--json", "-")
        assert said.returncode == 0, said.stderr
        digests.append(json.loads(said.stdout)["digest"])
    assert digests[0] == digests[1]


@pytest.mark.parametrize("verb", ["simulate", "launch", "evaluate --maps 2 --starts 1 --workers 2"])
def test_a_policy_that_raises_is_one_line_with_its_place(folder: Path, verb: str) -> None:
    (folder / "homing.py").write_text(POLICY.format(raises_at=60))
    said = swarm(folder, *verb.split(), "-n", "3", "--policy", "homing.py:Homing")
    assert said.returncode == 2, said.stderr
    assert said.stdout == ""
    line = "rsc-swarm: policy homing.py:Homing raised KeyError: 'oops' at homing.py:11 (act)"
    assert said.stderr.splitlines()[-1] == line
