"""Pauses: whatever is stopped for however long, the flight goes on afterwards as if nothing had happened."""

import json
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.scenarios.flights import Fields, Launcher
from tests.scenarios.test_twins import simulated

# Long enough for the strike to come in the middle.
FLIGHT: Fields = {"agents": 4, "goal_x_m": 1e6, "fly_s": 10, "obstacles": {"discs": []}}
PAUSE_S = 2.5  # longer than anyone's patience would be if it were counted by the wall clock: see test_server for hours


@pytest.fixture
def flight(tmp_path: Path) -> Iterator[Launcher]:
    launcher = Launcher(FLIGHT, tmp_path)
    launcher.await_tick(20)
    yield launcher
    launcher.clean_up()


@pytest.fixture(scope="module")
def undisturbed() -> Fields:
    return simulated(FLIGHT)


@pytest.mark.parametrize(
    "names", [["agent-2"], ["world"], ["agent-0", "agent-1", "agent-2", "agent-3"], ["everybody"]]
)
def test_who_is_stopped_and_goes_on_has_missed_nothing(
    flight: Launcher, undisturbed: Fields, names: list[str]
) -> None:
    pids = [flight.children[name].pid for name in names if name in flight.children]
    if names == ["everybody"]:  # Ctrl-Z
        pids = [flight.process.pid, *(child.pid for child in flight.children.values())]
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    time.sleep(PAUSE_S)
    for pid in pids:
        os.kill(pid, signal.SIGCONT)
    code, said = flight.end()
    outcome = json.loads(said[-1])
    assert (code, outcome["lost"], outcome["failure"]) == (0, [], "late")
    assert (outcome["ticks"], outcome["digest"]) == (undisturbed["ticks"], undisturbed["digest"])
