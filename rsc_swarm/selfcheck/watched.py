"""A command under watch: started in a session and folders of its own, struck, and looked at when it has ended."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil
from pydantic import ValidationError

from rsc_swarm.flight.report import FlightReport
from rsc_swarm.machine.leaving import passing_folder
from world.outlets.trajectory import Trajectory, TrajectoryError

# A flight that is never at its goal and of known length.
SMALL = ("--set", "goal_x_m=1e6", "--set", "obstacles.discs=[]", "--set", "fly_s=6")
ASKING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_CODES = (0, 1, 2, 3, 130)
_PATIENCE_S, _GONE_S = 180.0, 20.0
_COMPANY = ("t ", "compiling", "agent ", "world: ")  # lines on stderr that are no complaints
_OURS = ("run", "sent.json")


@dataclass
class Seen:
    """What was seen of a command: ``left``: processes and files that are still there. asked: to leave, before it was over."""

    code: int | None
    out: str
    err: str
    left: list[str]
    report: bool
    trajectory: bool
    asked: bool

    @property
    def flew(self) -> bool:
        """Whether it showed a tick."""
        return any(line.startswith("t ") for line in self.err.splitlines())

    @property
    def complaints(self) -> list[str]:
        """Lines on stderr that say what is wrong."""
        return [line for line in self.err.splitlines() if line and not line.startswith(_COMPANY)]


@dataclass
class Watched:
    """A command that runs. ``here`` is its own: sockets, temporary files, ``run`` and ``sent.json``."""

    here: Path
    process: "subprocess.Popen[str]"
    asked: bool = False

    def children(self) -> dict[str, psutil.Process]:
        """Its processes by name, as far as they live: ``world``, ``agent-0``, ..., and ``launcher``."""
        found = {}
        for process in _processes_of(self.process.pid):
            try:
                name = Path(os.readlink(f"/proc/{process.pid}/fd/1")).stem
            except OSError:
                continue
            found["launcher" if process.pid == self.process.pid else name] = process
        return found

    def strike(self, name: str, number: signal.Signals) -> bool:
        """Send a signal to one of its processes, or to all (``everybody``); False if there is none of that name."""
        known = self.children()
        if number in ASKING and self.process.poll() is None and not (self.here / "sent.json").exists():
            self.asked = True
        for process in known.values() if name == "everybody" else [known[name]] if name in known else []:
            try:
                process.send_signal(number)
            except psutil.NoSuchProcess:
                continue
        return name == "everybody" or name in known

    def end(self) -> Seen:
        """Wait for its end, and look what it has left behind."""
        try:
            out, err = self.process.communicate(timeout=_PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.clean_up()
            out, err = self.process.communicate()
            err += f"\nit had not ended after {_PATIENCE_S:g} s"
        deadline = time.monotonic() + _GONE_S
        while (left := self._left()) and time.monotonic() < deadline:
            time.sleep(0.05)
        self.clean_up()
        run = self.here / "run"
        return Seen(
            self.process.returncode,
            out,
            err,
            left,
            _is_report(run / "report.json"),
            _is_path(run / "trajectory.npz"),
            self.asked,
        )

    def clean_up(self) -> None:
        """End all that is left of it."""
        for process in _processes_of(self.process.pid):
            process.kill()

    def _left(self) -> list[str]:
        living = [f"process {process.pid}" for process in _processes_of(self.process.pid)]
        files = [path.name for path in self.here.iterdir() if path.name not in _OURS]
        run = self.here / "run"
        return (
            living
            + files
            + [path.name for path in (run.iterdir() if run.is_dir() else ()) if path.name[0] == "."]
        )


def answers(pid: int, number: signal.Signals = signal.SIGTERM) -> bool:
    """Whether the process handles this signal by now. Before, it is Python that starts, and none of ours."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return True  # it has ended
    caught = next((line for line in status.splitlines() if line.startswith("SigCgt:")), "SigCgt: 0")
    return bool(int(caught.split()[1], 16) >> (number - 1) & 1)


def start(words: list[str], here: Path, prepare: Callable[[], None] = lambda: None, sh: str = "") -> Watched:
    """Start a flight: ``words`` of the command, with all its files in ``here``; return when it answers signals itself.

    Args:
        prepare: called in the new process, to limit it. sh: redirections.
    """

    def begin() -> None:
        for number in ASKING:  # of what is started in the background, or by nohup, some are ignored
            signal.signal(number, signal.SIG_DFL)
        prepare()

    command = [sys.executable, "-m", "rsc_swarm", *words]
    command += ["--run-dir", str(here / "run"), "--json", str(here / "sent.json")]
    process = subprocess.Popen(
        ["sh", "-c", f'exec "$@" {sh}', "sh", *command],
        env={**os.environ, "XDG_RUNTIME_DIR": str(here), "TMPDIR": str(here), "RSC_SWARM_TRACEBACK": ""},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=begin,
    )
    while process.poll() is None and not answers(process.pid):
        time.sleep(0.001)
    return Watched(here, process)


def length_of(verb: str) -> float:
    """How long a small ``launch`` or ``simulate`` takes here from the moment in which it answers signals, s, when nothing happens
    to it."""
    took = 0.0
    for _ in range(2):  # the first may compile
        with passing_folder("rsc-swarm-check-") as folder:
            watched = start([verb, "--agents", "4", *SMALL], folder)
            begin = time.monotonic()
            watched.end()
            took = time.monotonic() - begin
    return took


@contextmanager
def busy(loops: int) -> Iterator[None]:
    """So many processes that do nothing, as fast as they can."""
    loads = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(loops)]
    try:
        yield
    finally:
        for load in loads:
            load.kill()
            load.wait()


EARLY = 0.3  # share of a command's time by which its flight is not over, however the load changes


def common_faults(seen: Seen, asked_early: bool, troubles: int = 1) -> list[str]:
    """What no command may do, whatever happens to it; nor fly on when it was asked to leave long before it was over.

    Args:
        troubles: how many things may be wrong at once, each of which it says in a line.
    """
    faults = [f"left behind: {', '.join(seen.left)}"] if seen.left else []
    if "Traceback" in seen.err + seen.out or "Exception ignored" in seen.err:
        faults.append("a traceback")
    if seen.code not in _CODES:
        faults.append(f"exit code {seen.code}")
    if asked_early and seen.asked and seen.code in (0, 1):
        faults.append("it was asked to leave and flew on")
    told = seen.complaints
    expected = {2: (1,), 3: range(1, troubles + 1), 130: (0, 1)}.get(seen.code or 0, (0,))
    if seen.out.startswith("BROKEN: "):
        expected = (0, 1)  # the report says it itself, and at most something could not be kept besides
    if len(told) not in expected:
        faults.append(f"{len(told)} lines that complain: {told}")
    return faults


def _processes_of(session: int) -> list[psutil.Process]:
    """The processes of this session, without those that have ended and await their burial."""
    found = []
    for process in psutil.process_iter():
        try:
            if os.getsid(process.pid) == session and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process)
        except (OSError, psutil.NoSuchProcess):
            continue
    return found


def _is_report(path: Path) -> bool:
    try:
        FlightReport.model_validate_json(path.read_bytes())
    except (OSError, ValidationError):
        return False
    return True


def _is_path(path: Path) -> bool:
    try:
        return len(Trajectory.load(path).positions) > 1
    except TrajectoryError:
        return False
