"""The examples run, and the documents show them as they are."""

import json
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import rsc_swarm as rs

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"


def main_of(name: str):
    return runpy.run_path(str(EXAMPLES / name))["main"]


def test_a_mission_of_ones_own_is_flown(capsys):
    main_of("fly_wedge.py")()
    told = capsys.readouterr().out.splitlines()
    assert told[0].startswith("success: True, the 4 agents left of 5 in formation")
    assert len(told) == 1 + 4


def test_a_shape_is_read_from_a_table(capsys):
    main_of("shape_from_csv.py")()
    assert capsys.readouterr().out.startswith("all 6 agents in formation")


def test_a_controller_of_ones_own_is_measured(capsys):
    main_of("tune_homing.py")(maps=1)
    assert [line.partition(": ")[2] for line in capsys.readouterr().out.splitlines()] == [
        "homing.py:Homing",
        "analytic",
    ]


def test_a_controller_of_ones_own_does_what_it_says():
    mission = rs.mission(
        agents=4, obstacles={"discs": []}, policy=f"{EXAMPLES / 'homing.py'}:Homing", target={"speed_mps": 2}
    )
    assert rs.simulate(mission).report.tau_s == pytest.approx((35 + 5) / 2, abs=2.5)  # as fast as its target


def test_faults_are_tested():
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", "/dev/null", "test_swarm.py"],
        cwd=EXAMPLES, env={"PYTHONPATH": str(ROOT), "PATH": "", "HOME": str(Path.home())}, capture_output=True, text=True,
        timeout=120,
    )  # fmt: skip
    assert "3 passed" in run.stdout, run.stdout + run.stderr


def test_a_controller_of_ones_own_is_tested_in_ten_lines():
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "rsc_swarm.testing.plugin", "-c", "/dev/null",
         "test_survival.py"],
        cwd=EXAMPLES, env={"PYTHONPATH": str(ROOT), "PATH": "", "HOME": str(Path.home())}, capture_output=True, text=True,
        timeout=240,
    )  # fmt: skip
    assert "1 passed" in run.stdout, run.stdout + run.stderr


def test_the_notebook_runs_from_top_to_bottom(capsys):
    pytest.importorskip("matplotlib").use("Agg")
    notebook = json.loads((EXAMPLES / "flight.ipynb").read_text())
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    names = {"__name__": "__main__"}
    for cell in cells:
        exec("".join(cell["source"]), names)
    shown = [
        "".join(out["text"]) for cell in cells for out in cell["outputs"] if out["output_type"] == "stream"
    ]
    assert capsys.readouterr().out == "".join(shown)
    assert (EXAMPLES / "flight.ipynb").stat().st_size < 100_000


def test_every_example_is_told():
    told = set(re.findall(r"`(\w+\.\w+)`", (EXAMPLES / "README.md").read_text()))
    assert told == {path.name for path in EXAMPLES.iterdir() if path.is_file()} - {"README.md"}


@pytest.mark.parametrize("page", ["README.md", "docs/policies.md", "docs/campaigns.md"])
def test_what_a_page_shows_as_a_file_is_that_file(page):
    blocks = re.findall(r"```\w+\n(# (\w+\.\w+)\n.*?)```", (ROOT / page).read_text(), re.DOTALL)
    assert blocks
    for text, name in blocks:
        assert text == (EXAMPLES / name).read_text(), name
