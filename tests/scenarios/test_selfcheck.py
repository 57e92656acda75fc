"""One drone turns against the others, in real processes: they fly on and reach the goal. The whole is ``rsc-swarm selfcheck``."""

import json
import subprocess
import sys
from pathlib import Path

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


def test_an_attack_that_is_none_is_named(tmp_path: Path) -> None:
    run = subprocess.run(
        [sys.executable, "-m", "rsc_swarm", "selfcheck", "--attacks", "kindness"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 2
    assert run.stderr.splitlines()[-1].startswith(
        "rsc-swarm: --attacks kindness: is none; known are nested-note"
    )
