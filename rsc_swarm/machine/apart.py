"""Work that may never return, in a thread of its own: whoever is asked to leave can leave it behind.

A loop of Python, or a sleep, lets the main thread run. Compiled code holds the interpreter for as long as it likes, and no signal
is answered meanwhile: so another process looks on. It reads the numbers of signals from where the interpreter writes them the
moment they come; if the main thread has not answered one when the work has computed for `_HOLDS_S` since, it takes the
interpreter out of the thread's hands (`PyEval_SaveThread`, as the answer to a signal of its own), and the thread sleeps for good.
"""

import ctypes
import mmap
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextvars import copy_context
from types import FrameType
from typing import Any, TypeVar

from protocols.closing import Closing
from rsc_swarm.machine.leaving import Leave, be_worker, nobody_asks

_HOLDS_S, _LOOK_S = 0.4, 0.05
_RELEASE, _SLEEP = signal.SIGRTMIN + 5, signal.SIGRTMIN + 6
_ASKING = [bytes([number]) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")
T = TypeVar("T")


class LeftBehind(Exception):
    """The work did not return. frame: where it was; None: it had just begun."""

    def __init__(self, frame: FrameType | None = None) -> None:
        super().__init__("it did not return")
        self.frame = frame


class Apart(Closing):
    """A thread for work; made in the main thread, by a process that has no other that matters."""

    def __init__(self, leave: Leave, patience_s: float) -> None:
        """``patience_s``: for the work to return, once ``leave`` is asked for; asked for again, none."""
        self._leave, self._patience_s, self._until = leave, patience_s, 0.0
        self._work: queue.SimpleQueue[Callable[[], Any] | None] = queue.SimpleQueue()
        self._done: queue.SimpleQueue[tuple[Any, BaseException | None]] = queue.SimpleQueue()
        self._page = mmap.mmap(-1, 2)  # changes while the main thread waits; whether the thread was released
        libc = ctypes.CDLL(None)
        for number, answer in ((_RELEASE, ctypes.pythonapi.PyEval_SaveThread), (_SLEEP, libc.pause)):
            libc.signal(number, ctypes.cast(answer, ctypes.c_void_p))
        signal.pthread_sigmask(signal.SIG_BLOCK, {_RELEASE})  # it is for the thread alone
        context = copy_context()
        self._thread = threading.Thread(target=context.run, args=(self._run,), daemon=True)
        self._thread.start()
        reader, self._writer = os.pipe()
        os.set_blocking(self._writer, False)
        with nobody_asks():
            self._guard = os.fork()
            if self._guard == 0:
                os.close(self._writer)
                self._look_on(reader)
        os.close(reader)
        self._wakeup = signal.set_wakeup_fd(self._writer, warn_on_full_buffer=False)
        leave.when_asked = self._asked

    def do(self, work: Callable[[], T]) -> T:
        """Have it done, and return or raise what it does.

        Raises:
            LeftBehind: it did not return in time.
        """
        self._work.put(work)
        while True:
            self._page[0] = (self._page[0] + 1) % 256
            try:
                result, error = self._done.get(timeout=_LOOK_S)
            except queue.Empty:
                if self._page[1] or (self._leave.asked and time.monotonic() > self._until):
                    raise self._leave_behind() from None
                continue
            if error is not None:
                raise error
            done: T = result
            return done

    def _leave_behind(self) -> LeftBehind:
        self._dismiss()
        thread = self._thread.ident or 0
        frame = sys._current_frames().get(thread)
        if self._page[1]:
            signal.pthread_kill(thread, _SLEEP)
        else:  # a loop of Python ends so
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(LeftBehind))
        return LeftBehind(frame)

    def close(self) -> None:
        self._dismiss()
        self._leave.when_asked = None
        self._work.put(None)

    def _dismiss(self) -> None:
        """Nobody looks on any more."""
        if self._guard:
            signal.set_wakeup_fd(self._wakeup)
            os.close(self._writer)
            os.kill(self._guard, signal.SIGKILL)
            os.waitpid(self._guard, 0)
            self._guard = 0

    def _asked(self, again: bool, frame: FrameType | None) -> None:
        self._until = time.monotonic() + (0.0 if again else self._patience_s)

    def _run(self) -> None:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {_RELEASE})
        while (work := self._work.get()) is not None:
            try:
                self._done.put((work(), None))
            except BaseException as error:
                self._done.put((None, error))

    def _look_on(self, reader: int) -> None:
        """In a process of its own, until it is killed."""
        try:
            be_worker()
            pid, thread = os.getppid(), self._thread.native_id
            while (said := os.read(reader, 1)) and said not in _ASKING:
                pass
            turn = computed = -1.0
            while True:
                if self._page[0] != turn:
                    turn, computed = self._page[0], _computed_s(pid, thread)
                elif _computed_s(pid, thread) - computed > _HOLDS_S:
                    self._page[1] = 1
                    os.kill(pid, _RELEASE)
                    break
                time.sleep(_LOOK_S)
        finally:
            os._exit(0)


def _computed_s(pid: int, thread: int | None) -> float:
    """CPU time of a thread so far."""
    with open(f"/proc/{pid}/task/{thread}/stat") as file:
        fields = file.read().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_S
