"""Small launchers in fresh interpreters: a launcher must be single threaded and must never have opened Zenoh, and some stories
kill it. The fixtures that tell them are in conftest.py.
"""

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import psutil

from tests.scenarios.flights import lives

ROOT = Path(__file__).resolve().parents[2]

PREAMBLE = """
import os, signal, sys, time
from pathlib import Path
from protocols.whole_file import write_whole
from rsc_swarm.flight.processes import Supervisor, leave_on_sigterm
from rsc_swarm.flight.socket_folder import RunFolder

here = Path(sys.argv[1])

def polite(name):
    leave = leave_on_sigterm()
    write_whole(here / name, str(os.getpid()))
    while not leave.asked:
        time.sleep(0.01)
    (here / f"{name} left").write_text("")

def stubborn(name):
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    write_whole(here / name, str(os.getpid()))
    time.sleep(60.0)

def beating(name):
    for beat in range(6000):
        write_whole(here / name, str(beat))
        time.sleep(0.01)

def await_files(*names):
    deadline = time.monotonic() + 5.0
    while not all((here / name).exists() for name in names):
        assert time.monotonic() < deadline, names
        time.sleep(0.005)
"""


def launcher(story: str, here: Path) -> "subprocess.Popen[str]":
    """Start ``story`` as a launcher whose run folders and children's files lie in ``here``."""
    return subprocess.Popen(
        [sys.executable, "-c", PREAMBLE + textwrap.dedent(story), str(here)],
        cwd=ROOT,
        env={**os.environ, "XDG_RUNTIME_DIR": str(here)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def run_folders(here: Path) -> list[Path]:
    return list(here.glob("rsc-swarm-run-*"))


def alive(here: Path, *names: str) -> list[str]:
    """Which of them live."""

    def is_alive(pid: int) -> bool:
        return psutil.pid_exists(pid) and lives(psutil.Process(pid))

    return [name for name in names if is_alive(int((here / name).read_text()))]
