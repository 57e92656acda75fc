"""Crashes: a drone that dies is named and the others fly on; whatever else dies, nothing is left behind."""

import json
import os
import re
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.scenarios.flights import Fields, Launcher

# Never at its goal, so that it is in the air whenever the test strikes.
ENDLESS: Fields = {"agents": 3, "goal_x_m": 1e6, "fly_s": 3600, "obstacles": {"discs": []}}
LONG: Fields = {**ENDLESS, "fly_s": 10}
NOTHING_LEFT_S = 20.0  # only what fails takes so long


@pytest.fixture
def launch(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[Fields], Launcher]]:
    begun: list[Launcher] = []

    def start(fields: Fields) -> Launcher:
        launcher = Launcher(fields, tmp_path_factory.mktemp("run"))
        begun.append(launcher)
        launcher.await_tick(50)
        assert sorted(launcher.children) == [*(f"agent-{agent}" for agent in range(3)), "world"]
        assert any(name.startswith("rsc-swarm-run-") for name in launcher.remains())
        return launcher

    yield start
    for launcher in begun:
        launcher.clean_up()


def last_event(flight: Launcher) -> Fields:
    lines = (flight.here / "run" / "events.jsonl").read_text().splitlines()
    return json.loads(lines[-1])


def test_a_drone_that_is_killed_breaks_the_run_and_is_named(launch: Callable[[Fields], Launcher]) -> None:
    """... and the others fly on to the end."""
    flight = launch(LONG)
    pid = flight.children["agent-2"].pid
    flight.hit("agent-2")
    code, said = flight.end(within_s=60)
    assert code == 3
    assert re.fullmatch(
        rf"broken: agent 2 was lost at t = [\d.]+ s without the mission's doing: its process \({pid}\) was ended by SIGKILL. "
        r"Those who were left: not in formation beyond the goal line within 10.00 s: .*, lost agent 2",
        said[-1],
    )
    assert flight.is_gone_within(NOTHING_LEFT_S)
    assert (flight.here / "run" / "trajectory.npz").is_file()
    assert last_event(flight)["why"] == "broken"


def test_a_drone_that_somebody_asks_to_leave_breaks_the_run_too(launch: Callable[[Fields], Launcher]) -> None:
    flight = launch(LONG)
    flight.hit("agent-0", signal.SIGTERM)
    code, said = flight.end(within_s=60)
    assert (code, "agent 0 was lost" in said[-1], "ended with exit code 0" in said[-1]) == (3, True, True)


def test_a_world_that_is_killed_breaks_the_run_in_one_line(launch: Callable[[Fields], Launcher]) -> None:
    flight = launch(ENDLESS)
    pid = flight.children["world"].pid
    flight.hit("world")
    code, said = flight.end(within_s=60)
    assert code == 3
    assert said == [f"broken: world (process {pid}) was ended by SIGKILL"]
    assert flight.is_gone_within(NOTHING_LEFT_S)


def test_when_all_drones_are_killed_nobody_calls_it_a_failure_of_the_controller(
    launch: Callable[[Fields], Launcher],
) -> None:
    flight = launch(ENDLESS)
    for agent in range(3):
        flight.hit(f"agent-{agent}")
    code, said = flight.end(within_s=60)
    assert (code, "was ended by SIGKILL" in said[-1]) == (3, True)


def test_a_launcher_that_is_killed_leaves_nothing_behind(launch: Callable[[Fields], Launcher]) -> None:
    flight = launch(ENDLESS)
    flight.process.kill()
    assert flight.is_gone_within(NOTHING_LEFT_S), flight.remains()


def test_a_launcher_stopped_with_its_drones_frozen_leaves_nothing_behind(
    launch: Callable[[Fields], Launcher],
) -> None:
    flight = launch({**ENDLESS, "faults": [{"at_s": 0.2, "kind": "freeze", "agents": [1, 2]}]})
    flight.process.kill()
    assert flight.is_gone_within(NOTHING_LEFT_S), flight.remains()


def test_ctrl_c_ends_all_and_leaves_nothing(launch: Callable[[Fields], Launcher]) -> None:
    flight = launch(ENDLESS)
    os.killpg(flight.process.pid, signal.SIGINT)  # a terminal sends it to every process of the launch
    code, said = flight.end(within_s=60)
    assert (code, json.loads(said[-1])["failure"]) == (130, "interrupted")
    assert flight.is_gone_within(NOTHING_LEFT_S), flight.remains()
    assert (flight.here / "run" / "trajectory.npz").is_file()
    assert last_event(flight)["why"] == "interrupted"


@pytest.mark.parametrize("apart_s", [0.0, 0.05, 0.3])
def test_ctrl_c_twice_loses_nothing_of_what_was_flown(
    launch: Callable[[Fields], Launcher], apart_s: float
) -> None:
    flight = launch(ENDLESS)
    os.killpg(flight.process.pid, signal.SIGINT)
    time.sleep(apart_s)
    os.killpg(flight.process.pid, signal.SIGINT)
    code, said = flight.end(within_s=60)
    assert code == 130
    assert json.loads(said[-1])["lost"] == []
    with np.load(flight.here / "run" / "trajectory.npz") as saved:
        assert len(saved["positions"]) == json.loads(said[-1])["ticks"] + 1


def test_a_launcher_that_is_terminated_leaves_nothing(launch: Callable[[Fields], Launcher]) -> None:
    flight = launch(ENDLESS)
    flight.process.terminate()
    flight.end(within_s=60)
    assert flight.is_gone_within(NOTHING_LEFT_S), flight.remains()


def test_a_finished_flight_leaves_its_logs_its_path_and_nothing_else(
    launch: Callable[[Fields], Launcher],
) -> None:
    flight = launch({**ENDLESS, "fly_s": 30})
    assert flight.end()[0] == 0
    assert flight.is_gone_within(NOTHING_LEFT_S)
    run: Path = flight.here / "run"
    assert (run / "trajectory.npz").stat().st_size > 0
    assert sorted(path.name for path in (run / "logs").iterdir()) == [
        *(f"agent-{agent}.log" for agent in range(3)),
        "world.log",
    ]
    assert (run / "logs" / "agent-1.log").read_text() == "agent 1: the flight is over\n"
