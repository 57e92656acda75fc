"""Whole launches that the machine strikes: whoever is killed, what was flown is kept, and nothing is left behind."""

import signal
import time
from dataclasses import replace
from pathlib import Path

import pytest

from rsc_swarm.selfcheck import interrupts, machine
from rsc_swarm.selfcheck.watched import SMALL, Seen, Watched, start


def in_flight(here: Path, *words: str) -> Watched:
    """A launch that has shown a tick."""
    long = [word.replace("fly_s=6", "fly_s=600") for word in SMALL]
    watched = start(["launch", "--agents", "3", *long, *words], here)
    assert watched.process.stderr is not None
    for line in watched.process.stderr:
        if line.startswith("t "):
            break
    return watched


@pytest.mark.parametrize(
    ("who", "code", "complains"), [("launcher", -signal.SIGKILL, False), ("world", 3, True)]
)
def test_whoever_is_killed_the_report_of_what_was_flown_is_kept(
    tmp_path: Path, who: str, code: int, complains: bool
) -> None:
    watched = in_flight(tmp_path)
    watched.strike(who, signal.SIGKILL)
    seen = watched.end()
    assert (seen.code, seen.report, seen.left) == (code, True, [])
    assert seen.trajectory is (who == "launcher"), "what it recorded dies with the world"
    assert [line for line in seen.complaints if "was ended by SIGKILL" in line] == seen.complaints
    assert bool(seen.complaints) is complains


def test_a_world_that_is_stopped_does_not_outlive_its_launcher(tmp_path: Path) -> None:
    watched = in_flight(tmp_path)
    watched.strike("world", signal.SIGSTOP)
    watched.strike("launcher", signal.SIGKILL)
    assert watched.end().left == []


def test_a_launcher_that_is_stopped_and_goes_on_has_missed_nothing(tmp_path: Path) -> None:
    watched = in_flight(tmp_path)
    watched.strike("launcher", signal.SIGSTOP)
    time.sleep(1.0)
    watched.strike("launcher", signal.SIGCONT)
    watched.strike("everybody", signal.SIGINT)
    seen = watched.end()
    assert (seen.code, seen.report, seen.trajectory, seen.left, seen.complaints) == (130, True, True, [], [])


@pytest.mark.parametrize("seed", [9, 14])
def test_random_faults_of_the_machine_find_nothing_wrong(tmp_path: Path, seed: int) -> None:
    plan = machine.draw(seed)
    assert machine.judge(plan, machine.fly(plan, tmp_path, length_s=3.0)) == []


def test_ctrl_c_at_a_random_moment_finds_nothing_wrong(tmp_path: Path) -> None:
    at, seen = interrupts.press(interrupts.draw(3, 4.0), tmp_path)
    assert interrupts.judge(seen, early=False) == [], at


def test_the_judge_names_what_is_wrong() -> None:
    """The checks can fail."""
    plan = machine.draw(0)
    assert plan == machine.draw(0)
    good = Seen(130, "STOPPED", "t 1 s\n", [], True, True, True)
    assert machine.judge(plan, good) == []
    bad = Seen(1, "", "t 1 s\nTraceback\nrsc-swarm: one\n", ["process 7", ".x"], False, False, True)
    assert machine.judge(plan, bad) == [
        "left behind: process 7, .x",
        "a traceback",
        "it was asked to leave and flew on",
        "2 lines that complain: ['Traceback', 'rsc-swarm: one']",
        "the report is lost",
        "the trajectory is lost",
    ]
    came_too_late = Seen(0, "SUCCESS", "t 6 s\n", [], True, True, False)
    assert interrupts.judge(came_too_late, early=True) == []
    assert interrupts.judge(replace(came_too_late, asked=True), early=True) == [
        "it was asked to leave and flew on"
    ]
