"""Whole swarms in real processes, launched from interpreters of their own.

A launcher must never have opened Zenoh, and some stories kill it: so none is the process of the tests.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil

ROOT = Path(__file__).resolve().parents[2]
Fields = dict[str, Any]

_FLY = """
import dataclasses, json, sys
from protocols.mission.document import parse_mission
from rsc_swarm.flight.launch import launch
from rsc_swarm.flight.report import report_of

clock, tasks = json.loads(sys.argv[1])
for fields in tasks:
    launched = launch(parse_mission(fields), clock)
    flown = launched.whole()
    print(json.dumps({
        "outcome": dataclasses.asdict(flown.outcome),
        "tally": flown.tally,
        "wall_s": flown.wall_s,
        "command_ages": flown.command_ages and flown.command_ages._asdict(),
        "breach": flown.watched.breach,
        "rejected": sum(sum(status.rejected) for status in flown.statuses.values()),
        "told": sorted(flown.statuses),
        "report": report_of(flown, parse_mission(fields), "launch", clock, "").model_dump(mode="json"),
    }), flush=True)
"""

_FLY_WATCHED = """
import json, os, sys
from pathlib import Path
from protocols.mission.document import parse_mission
from rsc_swarm.flight.launch import RunBroken, launch
from rsc_swarm.flight.report import describe
from rsc_swarm.machine.leaving import leave_when_asked

fields, here = json.loads(sys.argv[1])
def show(picture):
    print(picture.tick, flush=True)
def fly():
    try:
        launched = launch(parse_mission(fields), run_dir=Path(here), on_snapshot=show)
        if launched.error:
            raise launched.error
        outcome = launched.flown.outcome
    except RunBroken as error:
        return 3, f"broken: {error}"
    except KeyboardInterrupt:
        return 130, "stopped"
    if outcome.failure == "broken":
        return 3, f"broken: {describe(outcome, parse_mission(fields))}"
    told = {"lost": outcome.lost_agents, "ticks": outcome.ticks, "failure": outcome.failure, "digest": outcome.digest}
    return 130 if outcome.failure == "interrupted" else 0, json.dumps(told)
with leave_when_asked():  # as the command does: to the very end nobody who asks again disturbs what is told
    code, said = fly()
    print(said, flush=True)
    os._exit(code)
"""


WALL_CLOCK = ("mode", "clock", "wall_s", "real_time_factor", "first_tick_s", "pss_mb_per_agent", "again")


def whole(report: Fields) -> Fields:
    """All of a report that a flight decides, and not the machine it was flown on."""
    return {name: value for name, value in report.items() if name not in WALL_CLOCK}


def launched(*tasks: Fields, clock: str = "lockstep") -> list[Fields]:
    """Fly these missions one after the other in real processes; what came of each."""
    run = subprocess.run(
        [sys.executable, "-c", _FLY, json.dumps([clock, tasks])],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=200,
    )
    assert run.returncode == 0, run.stderr
    flights = [json.loads(line) for line in run.stdout.splitlines()]
    assert len(flights) == len(tasks)
    return flights


class Launcher:
    """A launch that is going to be disturbed. Its run folder lies in ``here``, its logs in ``here / run``."""

    def __init__(self, fields: Fields, here: Path) -> None:
        self.here = here
        run_dir = here / "run"
        run_dir.mkdir()
        self.process = subprocess.Popen(
            [sys.executable, "-c", _FLY_WATCHED, json.dumps([fields, str(run_dir)])],
            cwd=ROOT,
            env={**os.environ, "XDG_RUNTIME_DIR": str(here)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self.children: dict[str, psutil.Process] = {}

    def await_tick(self, tick: int) -> None:
        """Return when the flight has come this far."""
        assert self.process.stdout is not None
        while (line := self.process.stdout.readline().strip()).isdigit():
            if int(line) >= tick:
                self.children = {
                    name_of(child): child for child in psutil.Process(self.process.pid).children()
                }
                return
        raise AssertionError((line, self.process.communicate()))

    def hit(self, name: str, number: signal.Signals = signal.SIGKILL) -> None:
        self.children[name].send_signal(number)

    def end(self, within_s: float = 60.0) -> tuple[int, list[str]]:
        """Wait for the launcher's end; exit code and what it has said besides ticks."""
        out, err = self.process.communicate(timeout=within_s)
        assert "Traceback" not in err, err
        return self.process.returncode, [line for line in out.splitlines() if not line.isdigit()]

    def remains(self) -> list[str]:
        """Processes and files of the run that are still there."""
        living = [name for name, child in self.children.items() if lives(child)]
        return living + [path.name for path in self.here.iterdir() if path.name != "run"]

    def is_gone_within(self, seconds: float) -> bool:
        return eventually(lambda: not self.remains(), seconds)

    def clean_up(self) -> None:
        for child in self.children.values():
            if lives(child):
                child.kill()
        self.process.kill()
        self.process.communicate()


def name_of(child: psutil.Process) -> str:
    """``world`` or ``agent-3``: every process of a launch writes to a log of its own."""
    return Path(os.readlink(f"/proc/{child.pid}/fd/1")).stem


def lives(process: psutil.Process) -> bool:
    """Whether it runs. One that has ended and awaits its burial by the system's first process does not."""
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def eventually(happened: Callable[[], bool], within_s: float) -> bool:
    deadline = time.monotonic() + within_s
    while not happened():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True
