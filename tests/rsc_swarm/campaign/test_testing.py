"""Somebody else's controller is tested in ten lines, and a failure says what broke and how to fly it again."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from rsc_swarm.campaign.kept import all_kept, fly_kept

TEST = """
from hypothesis import given, settings
from rsc_swarm.testing import SETTINGS, missions

@settings(SETTINGS, max_examples=3, database=None, derandomize=True)
@given(mission=missions(agents=2, policy="{policy}", budget="none,restart=1", {fields}))
def test_{name}(swarm, mission):
    swarm.survives(mission)
"""
POLICY = """
class {name}:
    def __init__(self, mission): pass
    def act(self, seen):
        return {wanted}
"""
# Stands in for pytest-html, and says what it is given.
CONFTEST = """
class extras:
    html = staticmethod(lambda content: {"format_type": "html", "content": content})
    text = staticmethod(lambda content, name: {"format_type": "text", "content": content})

class Html:
    extras = extras

def pytest_configure(config):
    config.pluginmanager.register(Html(), "html")

def pytest_runtest_logreport(report):
    for extra in getattr(report, "extras", []):
        if extra["format_type"] == "html":
            print(f"HTML: {extra['content'][:15]}")
"""
BEGINNING = "fly_s=1.0, start={'radius_m': 0.0}"
TO_THE_GOAL = "goal_x_m=3, obstacles={'count': (0, 0)}, time_limit_s=5"
CONTROLLERS = {  # what each wants, and on what missions it is tested
    "good": ("1.5 * seen.slot_error - 2.5 * (seen.velocity - seen.target_velocity)", BEGINNING),
    "wrong": ("seen.nothing", BEGINNING),
    "still": ("-9.0 * seen.velocity", TO_THE_GOAL),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where all of them are tested."""
    folder = tmp_path_factory.mktemp("tested")
    (folder / "mine.py").write_text(
        "".join(POLICY.format(name=name, wanted=one[0]) for name, one in CONTROLLERS.items())
    )
    (folder / "conftest.py").write_text(CONFTEST)
    tests = [
        TEST.format(name=name, policy=f"{folder}/mine.py:{name}", fields=fields)
        for name, (_, fields) in CONTROLLERS.items()
    ]
    (folder / "test_mine.py").write_text("".join(tests))
    return folder


@pytest.fixture(scope="module")
def said(folder: Path) -> str:
    """What pytest says of them."""
    words = ["-q", "-p", "rsc_swarm.testing.plugin", "-p", "no:cacheprovider", "test_mine.py"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *words], cwd=folder, capture_output=True, text=True, timeout=250
    )
    assert done.returncode == 1, done.stdout
    return done.stdout


def test_one_that_keeps_all_passes(said: str) -> None:
    assert "2 failed, 1 passed" in said
    assert "FAILED test_mine.py::test_good" not in said


def test_one_that_raises_is_named_with_its_line(said: str) -> None:
    place = 1 + POLICY.count("\n") + 4
    assert f"mine.py:{place} (act)" in said


def test_a_failure_is_told_with_the_command_that_flies_it_again(said: str, folder: Path) -> None:
    assert "not in formation in time: not in formation beyond the goal line within" in said
    assert "Fly it again:  rsc-swarm simulate --mission swarm-failures/not-in-formation-in-time/" in said
    assert "Traceback" not in said
    kept = all_kept(folder / "swarm-failures")
    assert all(one.digest == fly_kept(one).digest for one in kept)
    assert kept[0].mission.faults == (), "Hypothesis shrinks to a mission without trouble"

    told = re.search(r"^What, when, why: (swarm-failures/.+\.html)$", said, re.MULTILINE)
    assert told
    page = (folder / told[1]).read_text(encoding="utf-8")
    assert "not in formation beyond the goal line within" in page
    assert list(folder.glob("swarm-failures/*/*.html")) == [folder / told[1]], "of the shortest alone"
    assert said.count("HTML: <!doctype html>") == 1, "for pytest-html it goes along with the failure"
