"""``rs.launch``: real processes from a program, whatever that program has open already."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

import rsc_swarm as rs
from rsc_swarm.flight.events import json_lines
from rsc_swarm.flight.launch import launch
from rsc_swarm.flight.run_dir import RunDirError
from world.field import FieldError


def test_a_launch_from_a_program_is_the_flight_of_its_simulation(tmp_path):
    mission = rs.mission(agents=3, fly_s=1.0, faults=[{"at_s": 0.5, "kind": "restart", "agents": [1]}])
    simulated = rs.simulate(mission)  # this process now has a model open, which must not be forked
    launched = rs.launch(mission, run_dir=tmp_path / "run")
    assert launched.report.mode == "launch"
    assert launched.report.digest == simulated.report.digest
    assert (launched.trajectory.positions == simulated.trajectory.positions).all()
    assert (tmp_path / "run" / "logs" / "agent-1.log").is_file()
    assert (tmp_path / "run" / "events.jsonl").read_text() == json_lines(simulated.events)


HOMING = """
class Homing:
    def __init__(self, mission):
        pass

    def act(self, seen):
        if seen.tick == 20:
            raise KeyError("oops")
        return seen.slot_error
"""


def test_what_a_launcher_refuses_is_raised_here_in_its_words_and_as_its_kind(tmp_path):
    with pytest.raises(rs.PolicyError, match=r"^policy nowhere.py:Mine: nowhere.py cannot be read"):
        rs.launch(rs.mission(policy="nowhere.py:Mine"))
    crowded = rs.mission(agents=2, start={"gap_m": 50}, obstacles={"discs": []})
    with pytest.raises(FieldError, match=r"^agent 1 finds no free place within start.radius_m"):
        rs.launch(crowded)
    (tmp_path / "something").write_text("else")
    with pytest.raises(RunDirError, match="holds other things than a flight"):
        rs.launch(rs.mission(agents=2), run_dir=tmp_path)


def test_a_policy_that_raises_in_a_launch_is_the_policys_error_as_in_a_simulation(tmp_path):
    (tmp_path / "homing.py").write_text(HOMING)
    mission = rs.mission(agents=2, policy=f"{tmp_path}/homing.py:Homing")
    for fly in (rs.simulate, rs.launch):
        with pytest.raises(rs.PolicyError, match=r"raised KeyError: 'oops' at .*homing.py:8 \(act\)$"):
            fly(mission)


def test_who_asks_a_launch_to_leave_before_it_flies_is_not_told_that_the_world_was_ended():
    """The launcher ends it, maybe before it can answer."""

    def press_ctrl_c(ready: int) -> None:
        psutil.Process().children()[0].kill()  # the world was started first
        signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        launch(rs.mission(agents=2, policy="analytic"), on_gathered=press_ctrl_c)


LAUNCHING = """
import sys
import rsc_swarm as rs
import rsc_swarm.api

rsc_swarm.api._LEAVE_S = 1.0
try:
    rs.launch(rs.mission(agents=2, fly_s=600, policy="analytic"), clock="realtime", run_dir=sys.argv[1])
except KeyboardInterrupt:
    print("left")
"""


@pytest.mark.parametrize("whole_group", [True, False], ids=["a terminal's", "the program's alone"])
def test_ctrl_c_in_a_program_keeps_what_its_launch_has_flown(tmp_path: Path, whole_group: bool) -> None:
    """The launcher was killed a quarter of a second after Ctrl-C, however far it was with leaving."""
    folder = tmp_path / "run"
    program = subprocess.Popen(
        [sys.executable, "-c", LAUNCHING, str(folder)],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    while not flying(psutil.Process(program.pid)):
        time.sleep(0.05)
    time.sleep(1.0)
    for stopped in (True, False):  # so that leaving takes its time
        for process in psutil.Process(program.pid).children():
            process.suspend() if stopped else process.resume()
        if stopped:
            (os.killpg if whole_group else os.kill)(program.pid, signal.SIGINT)
            time.sleep(0.5)
    assert program.communicate(timeout=30)[0] == "left\n"
    report = rs.FlightReport.model_validate_json((folder / "report.json").read_text())
    assert report.failure == "interrupted"


def flying(program: psutil.Process) -> bool:
    """Whether the launch of this program has its world and two drones."""
    return len(program.children(recursive=True)) >= 4
