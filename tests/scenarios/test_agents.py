"""Swarms that are spread over hosts: the world on one, and on each other many drones by one command."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

from protocols.mission.document import parse_mission
from rsc_swarm.flight.key_files import make_key_files
from rsc_swarm.flight.simulate import simulate
from tests.scenarios.flights import ROOT, eventually
from tests.scenarios.wires import Wires, address, why_not

COMMAND = [sys.executable, "-m", "rsc_swarm"]


def on_a_host(log: Path, *words: str) -> Callable[[], int]:
    """The command, in place of the process that calls this; what it says goes to ``log``."""

    def run() -> int:
        for number in (1, 2):
            os.dup2(os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644), number)
        os.chdir(ROOT)
        os.execv(sys.executable, [*COMMAND, *words])

    return run


def test_two_hosts_fly_twelve_drones_each_as_one_process_would(tmp_path: Path) -> None:
    if reason := why_not():
        pytest.skip(reason)
    make_key_files(tmp_path / "keys", "rsc", 24, [address(0)], 9, overwrite=False)
    endpoint, report = f"tls/{address(0)}:7447", tmp_path / "report.json"
    logs = [tmp_path / f"host-{host}.log" for host in range(3)]
    mission = {"agents": 24, "fly_s": 1.0, "policy": "analytic"}
    (tmp_path / "mission.yaml").write_text(json.dumps(mission))
    with Wires(3) as wires:
        keys = str(tmp_path / "keys")
        world = ("--mission", str(tmp_path / "mission.yaml"), "--keys", keys, "--json", str(report))
        processes = [wires.start(0, on_a_host(logs[0], "world", "--listen", endpoint, *world))]
        for host, numbers in ((1, "0-11"), (2, "12-23")):
            drones = ("--connect", endpoint, "--credentials-dir", keys, "--policy", "analytic")
            processes.append(wires.start(host, on_a_host(logs[host], "agents", numbers, *drones)))
        codes = [wires.wait(process) for process in processes]
    said = [log.read_text() for log in logs]
    assert codes == [1, 0, 0], said  # in so short a time no formation reaches its goal
    assert said[1].endswith("agents 0-11: the flight is over\n")
    assert said[2].endswith("agents 12-23: the flight is over\n")
    assert json.loads(report.read_text())["digest"] == simulate([parse_mission(mission)])[0].digest


@pytest.fixture
def started() -> Iterator[Callable[..., "subprocess.Popen[str]"]]:
    processes: list[subprocess.Popen[str]] = []

    def start(*words: str) -> "subprocess.Popen[str]":
        processes.append(subprocess.Popen([*COMMAND, *words], cwd=ROOT, stderr=subprocess.PIPE, text=True))
        return processes[-1]

    yield start
    for process in reversed(processes):
        process.kill()
        process.communicate()


def test_a_drone_that_dies_is_named_and_the_others_of_its_host_fly_on(
    tmp_path: Path, started: Callable[..., "subprocess.Popen[str]"]
) -> None:
    listen, logins = f"unixsock-stream/{tmp_path}/world.sock", str(tmp_path / "logins")
    long = ("--agents", "4", "--set", "fly_s=600", "--set", "goal_x_m=1e6", "--policy", "analytic")
    world = started("world", "--listen", listen, "--credentials-dir", logins, *long)
    assert eventually(lambda: (tmp_path / "world.sock").exists(), 60)
    drones = ("--connect", listen, "--credentials-dir", logins, "--policy", "analytic")
    here, there = started("agents", "0,2", *drones), started("agents", "1,3", *drones)
    assert here.stderr is not None
    assert there.stderr is not None
    assert here.stderr.readline().startswith("agents 0,2: ready after ")
    assert there.stderr.readline().startswith("agents 1,3: ready after ")

    victim = psutil.Process(there.pid).children()[1]
    victim.kill()
    died = f"agent 3: its process ({victim.pid}) was ended by SIGKILL"
    assert there.stderr.readline() == f"{died}; the others go on\n"

    children = psutil.Process(here.pid).children()
    assert len(children) == 2
    here.send_signal(signal.SIGINT)
    assert here.communicate(timeout=60)[1] == "agents 0,2: asked to leave\n"
    assert here.returncode == 130
    assert not any(child.is_running() for child in children)

    assert there.poll() is None
    world.send_signal(signal.SIGINT)
    assert there.communicate(timeout=60)[1].splitlines() == [died, "agent 1: the flight is over"]
    assert there.returncode == 3
