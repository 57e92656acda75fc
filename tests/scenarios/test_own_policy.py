"""A user's own policy in a file: the same flight in all commands, and the same line when it goes wrong in mid-flight."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
POLICY = """
from my_gains import GAIN


class Homing:
    def __init__(self, mission):
        pass

    def act(self, seen):
        if seen.tick == {at}:
            {does}
        return GAIN * seen.slot_error + 2.0 * (seen.target_velocity - seen.velocity)
"""


# The command, with a world that is sooner certain that a drone will not answer.
SOON = (
    "from world.server import patience; patience.WATCHED_S = 6.0; from rsc_swarm.cli.main import main; main()"
)


def swarm(
    folder: Path, *words: str, how: Sequence[str] = ("-m", "rsc_swarm.cli.main")
) -> subprocess.CompletedProcess[str]:
    """Run the command in this folder."""
    return subprocess.run(
        [sys.executable, *how, *words],
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
    (folder / "homing.py").write_text(POLICY.format(at=-1, does="pass"))
    digests = []
    for verb in ("simulate", "launch"):
        said = swarm(folder, verb, "-n", "3", "--policy", "homing.py:Homing", "--json", "-")
        assert said.returncode == 0, said.stderr
        digests.append(json.loads(said.stdout)["digest"])
    assert digests[0] == digests[1]


@pytest.mark.parametrize("verb", ["launch", "evaluate --maps 2 --starts 1 --workers 2"])
def test_a_policy_that_raises_is_one_line_with_its_place(folder: Path, verb: str) -> None:
    (folder / "homing.py").write_text(POLICY.format(at=60, does="raise KeyError('oops')"))
    said = swarm(folder, *verb.split(), "-n", "3", "--policy", "homing.py:Homing")
    assert said.returncode == 2, said.stderr
    assert said.stdout.partition(" at t")[0] == ("" if "evaluate" in verb else "STOPPED: interrupted")
    line = "rsc-swarm: policy homing.py:Homing raised KeyError: 'oops' at homing.py:11 (act)"
    assert said.stderr.splitlines()[-1] == line


def test_what_was_flown_before_a_policy_raised_is_kept(folder: Path) -> None:
    (folder / "homing.py").write_text(POLICY.format(at=60, does="raise KeyError('oops')"))
    said = swarm(
        folder, "simulate", "-n", "3", "--policy", "homing.py:Homing", "--run-dir", "run", "--json", "r.json"
    )
    assert said.returncode == 2
    line = "rsc-swarm: policy homing.py:Homing raised KeyError: 'oops' at homing.py:11 (act)"
    assert said.stderr.splitlines()[-1] == line
    assert said.stdout.partition(" at t")[0] == "STOPPED: interrupted"
    kept = json.loads((folder / "r.json").read_text())
    assert kept == json.loads((folder / "run" / "report.json").read_text())
    assert (kept["success"], kept["failure"], kept["ticks"]) == (False, "interrupted", 60)
    assert kept["detail"].endswith("policy homing.py:Homing raised KeyError: 'oops' at homing.py:11 (act)")
    assert (folder / "run" / "report.txt").read_text().startswith("STOPPED: interrupted at t = 0.60 s: ")
    with np.load(folder / "run" / "trajectory.npz") as saved:
        assert len(saved["positions"]) == 61


SPIN = "def spin(turns):\n    while turns > 0:\n        turns += 1\n"
TOLD = "print('in it', flush=True)"
# What comes first, and then what does not return. To compile is not what hangs: it goes deeper than a stack is told.
HANGS = {
    "loop": ("pass", "while True: pass"),
    "compiled": ("import numba; spun = numba.njit(spin); spun(0)", "spun(1)"),
}


def stopped(folder: Path, at: int, hangs: str, *words: str) -> list[str]:
    """Ctrl-C as soon as the policy is at tick ``at``, from which it does not return; the last lines of what is said."""
    first, hang = HANGS[hangs]
    does = f"{first}; {TOLD}\n            {hang}"
    (folder / "homing.py").write_text(f"{POLICY.format(at=at, does=does)}\n\n{SPIN}")
    return interrupted(folder, *words)


def interrupted(folder: Path, *words: str) -> list[str]:
    """Ctrl-C as soon as the policy says that it is in it; the last lines of what is said."""
    with subprocess.Popen(
        [sys.executable, "-m", "rsc_swarm.cli.main", *words, "-n", "3", "--policy", "homing.py:Homing"],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as run:  # fmt: skip
        assert run.stdout
        assert run.stdout.readline() == "in it\n"
        run.send_signal(signal.SIGINT)
        _, errors = run.communicate(timeout=60)
    assert run.returncode == 130, errors
    return errors.splitlines()


STUCK = "rsc-swarm: policy homing.py:Homing did not return: it was stopped at homing.py:12 (act)"


@pytest.mark.parametrize("hangs", HANGS)
def test_ctrl_c_names_a_policy_that_does_not_return_and_keeps_what_was_flown(
    folder: Path, hangs: str
) -> None:
    assert stopped(folder, 7, hangs, "simulate", "--run-dir", "run")[-1] == STUCK
    assert json.loads((folder / "run" / "report.json").read_text())["ticks"] == 7
    with np.load(folder / "run" / "trajectory.npz") as saved:
        assert len(saved["positions"]) == 8


@pytest.mark.parametrize("verb", ["simulate", "launch", "evaluate --maps 2"])
def test_ctrl_c_leaves_a_policy_that_does_not_return_from_its_first_tick(folder: Path, verb: str) -> None:
    assert stopped(folder, 0, "compiled", *verb.split())[-1] == STUCK


def test_a_policy_that_ends_its_process_is_named_and_what_was_flown_is_kept(folder: Path) -> None:
    (folder / "homing.py").write_text(POLICY.format(at=60, does="import os; os.kill(os.getpid(), 11)"))
    said = swarm(folder, "simulate", "-n", "3", "--policy", "homing.py:Homing", "--json", "r.json")
    assert said.returncode == 2
    line = "rsc-swarm: policy homing.py:Homing: the process in which it flew was ended by SIGSEGV"
    assert said.stderr.splitlines()[-1] == line
    assert json.loads((folder / "r.json").read_text())["ticks"] == 60


MAKES = "    def __init__(self, mission):\n        pass"


@pytest.mark.parametrize("does", ["import os; os._exit(7)", "import os; os.kill(os.getpid(), 11)"])
def test_a_policy_that_ends_its_process_when_it_is_made_is_named(folder: Path, does: str) -> None:
    ends = POLICY.format(at=-1, does="pass").replace(MAKES, MAKES.replace("pass", does))
    (folder / "homing.py").write_text(ends)
    said = swarm(folder, "mission", "--check", "--set", "policy=homing.py:Homing")
    assert (said.returncode, said.stdout) == (2, "")
    line = "rsc-swarm: policy homing.py:Homing: the process in which it flew "
    assert said.stderr.splitlines()[-1].startswith(line)


def test_ctrl_c_leaves_a_policy_that_is_never_made(folder: Path) -> None:
    first, hang = HANGS["compiled"]
    (folder / "homing_spin.py").write_text(SPIN)
    made = MAKES.replace("pass", f"from homing_spin import spin; {first}; {TOLD}\n        {hang}")
    (folder / "homing.py").write_text(POLICY.format(at=-1, does="pass").replace(MAKES, made))
    assert interrupted(folder, "simulate")[-1] == STUCK.replace(":12 (act)", ":8 (__init__)")


def test_what_a_policy_forks_does_not_fly(folder: Path) -> None:
    (folder / "homing.py").write_text(POLICY.format(at=3, does="import os; os.fork()"))
    said = swarm(
        folder, "launch", "-n", "2", "--policy", "homing.py:Homing", "--set", "fly_s=0.1", "--json", "-"
    )
    assert json.loads(said.stdout)["ticks"] == 10, said.stderr


def test_a_launch_names_the_policy_in_which_a_drone_is_lost(folder: Path) -> None:
    (folder / "homing.py").write_text(POLICY.format(at="9 and 1 in seen.me", does="while True: pass"))
    words = ["--set", "fly_s=1", "--json", "-"]
    said = swarm(folder, "launch", "-n", "3", "--policy", "homing.py:Homing", *words, how=("-c", SOON))
    assert said.returncode == 3, said.stderr
    (lost,) = json.loads(said.stdout)["struck_off"]
    assert (lost["agent"], lost["why"]) == (
        1,
        "it has not answered for 6 s; its policy has not returned from homing.py:11 (act)",
    )


def test_a_policy_may_print(folder: Path) -> None:
    (folder / "my_gains.py").write_text("print('read')\nGAIN = 1.0\n")
    (folder / "homing.py").write_text(POLICY.format(at=3, does="print('here')"))
    said = swarm(folder, "simulate", "-n", "3", "--policy", "homing.py:Homing", "--json", "-")
    assert json.loads(said.stdout)["policy"] == "homing.py:Homing"
    lines = said.stderr.splitlines()
    assert lines.count("here") == 1
    assert "read" in lines  # once in each process that loads it


def test_a_thread_of_a_policy_keeps_no_command_from_leaving(folder: Path) -> None:
    thread = "import threading, time; threading.Thread(target=time.sleep, args=(1e6,)).start()"
    (folder / "my_gains.py").write_text(f"{thread}\nGAIN = 1.0\n")
    (folder / "homing.py").write_text(POLICY.format(at=-1, does="pass"))
    said = swarm(folder, "mission", "--check", "--set", "policy=homing.py:Homing")
    assert (said.returncode, said.stderr) == (0, "")
    assert said.stdout.startswith("mission: can be flown")
