"""Asked to leave: Ctrl-C, SIGTERM or a closing terminal. What a process does then depends on what it has to lose.

- `leave_at_once`: nothing has been made yet. One line, and the process is gone: a KeyboardInterrupt could be swallowed
  (while a rule is compiled) or become a traceback (while a module is imported). The command begins so.
- `unwind_when_asked`: there are processes to end and files to close. KeyboardInterrupt, once.
- `leave_when_asked`: a flight is under way. Nothing is raised: its loop looks at `Leave.asked`, and then all is told and kept.

What whoever started the process wants ignored (``nohup``, a job in the background) stays ignored. The first process of a
container is asked like any other: a signal that it does not handle would never reach it. Imports nothing that takes time.
"""

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

_ASKING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_UNWIND_S = 10.0  # for who was asked and has not left by then
_PR_SET_PDEATHSIG = 1
_STOPPED = 130  # protocols.errors.ExitCode.INTERRUPTED, which is not imported yet

_passing: dict[Path, int] = {}  # folders that go when this process does, and whose they are

_Handler = Callable[[int, FrameType | None], None] | signal.Handlers


class Leave:
    """Whether this process has been asked to leave, and whether again. Its loop looks at ``asked`` at least every 0.2 s.

    ``patient``: however often it is asked; if not, the second time ends the process.
    """

    def __init__(self, patient: bool = True) -> None:
        self.asked = self.again = False
        self._patient = patient

    def __call__(self, number: int, frame: FrameType | None) -> None:
        self.again, self.asked = self.asked, True
        if self.again and not self._patient:
            _vanish(number, frame)


def leave_at_once() -> None:
    """From now on, and unless something else is said below: one line, and the process is gone."""
    _answer(_vanish)


def all_is_done() -> None:
    """From now on whoever asks comes too late: the process is leaving, and how it ended is settled.

    What is ignored stays so to the end. Any other answer Python takes back while it leaves, and then a signal would kill it.
    """
    _answer(signal.SIG_IGN)


@contextmanager
def unwind_when_asked() -> Iterator[None]:
    """Within the block the first signal raises KeyboardInterrupt; the second, or ten seconds, ends the process at once."""

    def unwind(number: int, frame: FrameType | None) -> None:
        _answer(_vanish)
        signal.signal(signal.SIGALRM, _vanish)
        signal.setitimer(signal.ITIMER_REAL, _UNWIND_S)
        raise KeyboardInterrupt

    with _answering(unwind):
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)


@contextmanager
def leave_when_asked(patient: bool = True) -> Iterator[Leave]:
    """Within the block signals only ask to leave, however often: what was flown is told and saved first. Where there is nothing
    to save one need not be ``patient``: then the second ends the process, whose policy may not return.

    A block within a block is told what the outer one was.
    """
    outer = [answer for answer in map(signal.getsignal, _ASKING) if isinstance(answer, Leave)]
    leave = outer[0] if outer else Leave(patient)
    with _answering(leave):
        yield leave


@contextmanager
def nobody_asks() -> Iterator[set[int | signal.Signals]]:
    """Within the block signals wait: for a fork, whose child must not hear them before it has put its own answers in place.

    Yields:
        The signals that waited before; for the child, which is to wait for no others either.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
    try:
        yield before
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def passing_folder(prefix: str = "rsc-swarm-passing-", beside: Path | None = None) -> Iterator[Path]:
    """A private folder among the temporary ones, or in ``beside``, that is gone after the block: also for who leaves at once.

    That of who was killed outright is gone with the next of this name.
    """
    from tempfile import gettempdir  # loads much that most commands need later, if at all

    from rsc_swarm.machine.abandoned import make_folder

    with nobody_asks():
        folder, held = make_folder(prefix, beside or Path(gettempdir()))
        _passing[folder] = os.getpid()
    try:
        yield folder
    finally:
        os.close(held)
        _remove_passing(folder)


def _remove_passing(*folders: Path) -> None:
    from shutil import rmtree

    for folder in folders:
        if _passing.get(folder) == os.getpid():  # a child that was forked meanwhile leaves it alone
            rmtree(folder, ignore_errors=True)
            _passing.pop(folder, None)


def be_worker() -> None:
    """Begin as a forked worker: Ctrl-C and a closing terminal are for who forked it, and it does not outlive that one."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)


def _answer(handler: _Handler) -> dict[signal.Signals, Any]:
    """Answer all three with ``handler``; what answered before, of those that were not ignored."""
    before = {number: signal.getsignal(number) for number in _ASKING}
    changed = {number: old for number, old in before.items() if old is not signal.SIG_IGN}
    for number in changed:
        signal.signal(number, handler)
    return changed


@contextmanager
def _answering(handler: _Handler) -> Iterator[None]:
    """`_answer` within the block. Elsewhere than in a process's main thread no signals arrive, and nothing is changed."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = _answer(handler)
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)


def _vanish(number: int, frame: FrameType | None) -> None:
    show_cursor = "\x1b[?25h\r\x1b[K" if sys.__stderr__ and sys.__stderr__.isatty() else ""
    try:
        os.write(2, f"{show_cursor}rsc-swarm: stopped\n".encode())
        _remove_passing(*_passing)
    finally:
        os._exit(_STOPPED)
