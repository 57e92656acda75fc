"""The processes of a launch: the world and the drones are children of one launcher, and none outlives it.

- The launcher is single threaded and never opens Zenoh. It imports and warms everything once and then
  forks, so a drone starts in milliseconds and shares its code with all others. ``os.fork`` rather than
  ``multiprocessing``: a child here has no pipes, exit handlers or helper process of its parent's, and
  leaves by ``os._exit``.
- Every child ignores Ctrl-C, Ctrl-\\ and a closing terminal (the launcher answers both), writes to its own log, and
  gets a signal from the kernel when the launcher dies, however it dies.
- A drone is then killed outright. The world is asked to leave, so that it can finish its record, and
  removes the folder of the run.
- Linux only: it rests on ``prctl`` and on process file descriptors.
"""

import ctypes
import gc
import os
import re
import select
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any, NamedTuple, NoReturn, Self

from agent.policy import policy_file
from protocols.errors import BrokenError
from rsc_swarm.flight.socket_folder import remove_run_folder
from rsc_swarm.machine.leaving import Leave, nobody_asks
from rsc_swarm.machine.priority import give_way
from rsc_swarm.machine.streams import mute_stream

_PR_SET_PDEATHSIG = 1
_LEAVE_WITHOUT_LAUNCHER_S = 10.0  # to save a flight and tidy up takes a busy machine some
_ZENOH_THREAD = re.compile(r"(app|acc|tx|rx|net)-\d+")

_libc = ctypes.CDLL(None, use_errno=True)
_launcher_pid = 0  # in a child: its launcher; in the launcher: 0


class StartError(BrokenError):
    """The machine lets no further process start; one line says why."""


def how_ended(code: int) -> str:
    """In words, what os.waitstatus_to_exitcode says of a process."""
    return f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"


class Exit(NamedTuple):
    """How a child ended: with an exit code, or by a signal."""

    name: str
    pid: int
    code: int | None
    signal: int | None

    @property
    def how(self) -> str:
        return how_ended(self.code or 0 if self.signal is None else -self.signal)

    def __str__(self) -> str:
        return f"{self.name} (process {self.pid}) {self.how}"


def leave_on_sigterm() -> Leave:
    """From now on SIGTERM asks this process to leave instead of ending it, so that it can close its link.

    SIGCONT does too, once the launcher has died: it reaches also who is stopped. Then nobody will come with SIGKILL: the kernel's
    alarm clock does it.
    """
    leave = Leave()

    def ask(number: int, _frame: FrameType | None) -> None:
        if launcher_died():
            signal.setitimer(signal.ITIMER_REAL, _LEAVE_WITHOUT_LAUNCHER_S)
        elif number == signal.SIGCONT:
            return
        leave.asked = True

    signal.signal(signal.SIGTERM, ask)
    signal.signal(signal.SIGCONT, ask)
    return leave


def be_drone() -> Leave:
    """In a child that is one of many drones: fly from now on as such a process does. Whether it has been asked to leave."""
    give_way()
    gc.set_threshold(100_000)  # a tick leaves no cycles behind
    policy_file.hold()
    return leave_on_sigterm()


def launcher_died() -> bool:
    """In a child: whether its launcher is gone. Always False in the launcher itself."""
    return _launcher_pid != 0 and os.getppid() != _launcher_pid


class Start(NamedTuple):
    """A child that is to be: it calls ``target(*args)``.

    name: who it is, in reports and in its log; one may be used again once its process has ended. log: where stdout and stderr
    go (appended); None: where the launcher's go. at_launcher_death: what the kernel sends it then; SIGCONT (`leave_on_sigterm`)
    for one that leaves soon by itself. run_folder: removed by the child when it leaves after its launcher has died.
    """

    name: str
    target: Callable[..., object]
    args: tuple[Any, ...]
    log: Path | None = None
    at_launcher_death: signal.Signals = signal.SIGKILL
    run_folder: Path | None = None


class _Child(NamedTuple):
    name: str
    pid: int
    pidfd: int


class Supervisor:
    """Starts, watches and ends the children of this process.

    Leaving its ``with`` block, in whatever way, ends them all, after ``grace_s`` by force.
    """

    def __init__(self, grace_s: float = 2.0) -> None:
        self._grace_s = grace_s
        self._children: dict[str, _Child] = {}

    @property
    def running(self) -> tuple[str, ...]:
        """Names of the children whose end has not been reported yet, in the order of their start."""
        return tuple(self._children)

    def pid(self, name: str) -> int:
        return self._child(name).pid

    def start(
        self,
        name: str,
        target: Callable[..., object],
        *args: Any,
        log: Path | None = None,
        at_launcher_death: signal.Signals = signal.SIGKILL,
        run_folder: Path | None = None,
    ) -> int:
        """As `start_all`, of one child; returns its process number."""
        return self.start_all([Start(name, target, args, log, at_launcher_death, run_folder)])[0]

    def start_all(self, starts: Sequence[Start]) -> list[int]:
        """Fork a child for each; returns their process numbers.

        Together, because memory that this process writes to between two forks is no longer shared with the first child.

        Raises:
            ValueError: a name is still running, or there twice.
            RuntimeError: this process has opened Zenoh; what it forks would hang.
            StartError: the machine allows no more processes. Those forked before are running.
        """
        names = [start.name for start in starts]
        for index, name in enumerate(names):
            if name in self._children or name in names[:index]:
                raise ValueError(
                    f"{name} is still running: stop it, or kill it and poll until its end is reported, "
                    "before starting it again"
                )
        _refuse_to_fork_zenoh()
        sys.stdout.flush()
        sys.stderr.flush()
        sys._clear_type_cache()  # of names looked up last: each that a child adds would write to the one it replaces
        launcher, pids = os.getpid(), list[int]()
        with nobody_asks() as blocked:
            try:
                for start in starts:
                    pid = os.fork()
                    if pid == 0:
                        _be_child(launcher, start, blocked)
                    pids.append(pid)
            except OSError as error:
                raise StartError(
                    f"{names[len(pids)]} cannot be started ({error.strerror}): allow more processes (ulimit -u, or the "
                    "container's limit) or more memory, or fly fewer drones"
                ) from None
            finally:
                for name, pid in zip(names, pids, strict=False):
                    self._children[name] = _Child(name, pid, os.pidfd_open(pid))
        return pids

    def poll(self) -> list[Exit]:
        """The children that have ended since the last call. Each end is reported once."""
        ended = []
        for child in tuple(self._children.values()):
            pid, status = os.waitpid(child.pid, os.WNOHANG)
            if pid:
                ended.append(self._bury(child, status))
        return ended

    def wait(self, timeout_s: float, names: Iterable[str] | None = None) -> list[Exit]:
        """Sleep until a child (one of ``names``) has ended or ``timeout_s`` is over; then as ``poll``."""
        ends = select.poll()
        for name in self.running if names is None else names:
            if name in self._children:
                ends.register(self._children[name].pidfd, select.POLLIN)
        ends.poll(max(0.0, 1e3 * timeout_s))
        return self.poll()

    def stop(self, grace_s: float, names: Iterable[str] | None = None) -> list[Exit]:
        """End the children (all, or ``names``): SIGTERM, and SIGKILL for those still there after ``grace_s``.

        Frozen ones are thawed to hear it. Returns all ends that came to light, in that order.
        """
        asked = [name for name in (self.running if names is None else names) if name in self._children]
        ended: list[Exit] = []
        try:
            for name in asked:
                self.ask(name)
            deadline = time.monotonic() + grace_s
            while any(name in self._children for name in asked) and time.monotonic() < deadline:
                ended += self.wait(deadline - time.monotonic(), asked)
        finally:  # also when Ctrl-C comes a second time
            for name in asked:
                if name in self._children:
                    self._signal(name, signal.SIGKILL)
            for name in asked:
                if name in self._children:
                    child = self._children[name]
                    ended.append(self._bury(child, os.waitpid(child.pid, 0)[1]))
        return ended

    def ask(self, name: str) -> None:
        """Ask one child to leave (SIGTERM), if it still runs; a frozen one is thawed to hear it."""
        if name in self._children:
            self._signal(name, signal.SIGTERM)
            self._signal(name, signal.SIGCONT)

    def kill(self, name: str) -> None:
        """SIGKILL one child; its end is reported by ``poll``."""
        self._child(name)
        self._signal(name, signal.SIGKILL)

    def freeze(self, name: str) -> None:
        """Stop one child in its tracks (SIGSTOP), as a hung process would be."""
        self._child(name)
        self._signal(name, signal.SIGSTOP)

    def thaw(self, name: str) -> None:
        """Let a frozen child go on."""
        self._child(name)
        self._signal(name, signal.SIGCONT)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop(self._grace_s)

    def _child(self, name: str) -> _Child:
        if name not in self._children:
            raise ValueError(f"{name} is not running: running are {', '.join(self.running) or 'none'}")
        return self._children[name]

    def _signal(self, name: str, number: signal.Signals) -> None:
        # A child that has ended and is not buried yet keeps its number, and takes a signal without complaint.
        os.kill(self._children[name].pid, number)

    def _bury(self, child: _Child, status: int) -> Exit:
        os.close(child.pidfd)
        del self._children[child.name]
        code = os.waitstatus_to_exitcode(status)
        return Exit(child.name, child.pid, code if code >= 0 else None, -code if code < 0 else None)


def _refuse_to_fork_zenoh() -> None:
    for task in Path("/proc/self/task").iterdir():
        if _ZENOH_THREAD.fullmatch((task / "comm").read_text().strip()):
            raise RuntimeError(
                "this process has opened Zenoh, so a process forked from it would hang: "
                "start the swarm from a process that has not"
            )


def _be_child(launcher: int, start: Start, mask: set[int | signal.Signals]) -> NoReturn:
    """The whole life of a child. Never returns, so nothing of the launcher's runs twice."""
    global _launcher_pid
    name, target, args, log, at_launcher_death, run_folder = start
    code = 1
    try:
        _launcher_pid = launcher
        _libc.prctl(_PR_SET_PDEATHSIG, at_launcher_death, 0, 0, 0)
        if launcher_died():  # before the request was in place: then no signal comes any more
            os._exit(1)
        for number in signal.valid_signals():
            if callable(signal.getsignal(number)):
                signal.signal(number, signal.SIG_DFL)
        for answered_by_launcher in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT):
            signal.signal(answered_by_launcher, signal.SIG_IGN)
        signal.set_wakeup_fd(-1)
        if log is not None:
            _write_to(log)
        gc.freeze()  # the collector leaves the launcher's objects alone, so their memory stays shared
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        target(*args)
        code = 0
    except SystemExit as leaving:
        code = leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
    except BaseException as error:
        sys.stderr.write(f"{name}: {type(error).__name__}: {' '.join(str(error).split())}\n")
        if log is not None:
            traceback.print_exc()
    finally:
        try:
            sys.stdout.flush()
            sys.stderr.flush()
            if run_folder is not None and launcher_died():
                remove_run_folder(run_folder)
        finally:
            os._exit(code)


def _write_to(log: Path) -> None:
    """Send stdout and stderr to ``log``, and take stdin from nowhere. A log that cannot be written is no end of a drone."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    try:
        file = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    except OSError:
        file = os.dup(nowhere)
    for source, number in ((nowhere, 0), (file, 1), (file, 2)):
        os.dup2(source, number)
    os.close(nowhere)
    os.close(file)
    sys.stdout = mute_stream(1)
    sys.stderr = mute_stream(2)
