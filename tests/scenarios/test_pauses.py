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

# Long enough for all strikes to come in flight.
FLIGHT: Fields = {"agents": 4, "goal_x_m": 1e6, "fly_s": 15, "obstacles": {"discs": []}}
PAUSE_S = 2.0  # longer than anyone's patience would be if it were counted by the wall clock: see test_server for hours


PAUSED = [["agent-2"], ["world"], ["agent-0", "agent-1", "agent-2", "agent-3"], ["everybody"]]


@pytest.fixture
def flight(tmp_path: Path) -> Iterator[Launcher]:
    launcher = Launcher(FLIGHT, tmp_path)
    yield launcher
    launcher.clean_up()


def test_who_is_stopped_and_goes_on_has_missed_nothing(flight: Launcher) -> None:
    for turn, names in enumerate(PAUSED):
        flight.await_tick(20 + 100 * turn)
        pids = [flight.children[name].pid for name in names if name in flight.children]
        if names == ["everybody"]:  # Ctrl-Z
            pids = [flight.process.pid, *(child.pid for child in flight.children.values())]
        for pid in pids:
            os.kill(pid, signal.SIGSTOP)
        time.sleep(PAUSE_S)
        for pid in pids:
            os.kill(pid, signal.SIGCONT)
    undisturbed = simulated(FLIGHT)
    code, said = flight.end()
    outcome = json.loads(said[-1])
    assert (code, outcome["lost"], outcome["failure"]) == (0, [], "late")
    assert (outcome["ticks"], outcome["digest"]) == (undisturbed["ticks"], undisturbed["digest"])
