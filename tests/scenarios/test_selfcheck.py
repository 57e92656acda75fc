"""One drone turns against the others, in real processes: they fly on and reach the goal. The whole is ``rsc-swarm selfcheck``."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil

from tests.scenarios.flights import ROOT

# One of each kind: it floods, it lies, it breaks its reader, it reads nothing, it is gone.
ATTACKS = ["hellos", "no-permutation", "nested-note", "deaf", "exits"]


def test_nothing_that_one_drone_does_ends_or_spoils_the_flight_of_the_others(tmp_path: Path) -> None:
    figures = tmp_path / "figures.json"
    words = ["selfcheck", "--attacks", ",".join(ATTACKS), "--maps", "1", "-n", "4", "--json", str(figures)]
    run = subprocess.run(
        [sys.executable, "-m", "rsc_swarm", *words], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stdout + run.stderr
    trials = json.loads(figures.read_text())
    assert [trial["attack"] for trial in trials] == ATTACKS
    assert all(trial["honest_lost"] == [] and trial["succeeded"] for trial in trials)


def test_a_check_in_mid_flight_stops_when_asked_and_flies_no_other() -> None:
    words = ["selfcheck", "--attacks", "exits", "--maps", "9", "-n", "3"]
    with subprocess.Popen(
        [sys.executable, "-m", "rsc_swarm", *words],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as check:
        while len(psutil.Process(check.pid).children(recursive=True)) < 4:  # the world and its drones
            time.sleep(0.05)
        check.send_signal(signal.SIGINT)
        out, err = check.communicate(timeout=60)
    assert (check.returncode, err.splitlines()[-1]) == (130, "stopped after 0 of 9 flights"), out + err


def test_an_attack_that_is_none_is_named(tmp_path: Path) -> None:
    run = subprocess.run(
        [sys.executable, "-m", "rsc_swarm", "selfcheck", "--attacks", "kindness"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 2
    assert run.stderr.splitlines()[-1].startswith(
        "rsc-swarm: --attacks kindness: is none; known are nested-note"
    )
