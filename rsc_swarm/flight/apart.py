"""Work with a policy of somebody's own, in a process of its own: whoever is asked to leave can end it, whatever it is doing.

The process is forked, what it is told and what it answers goes through a pipe, and it ends with the one that forked it.
"""

import os
import select
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NoReturn

from agent.policy.base import PolicyError, PolicyStuck
from protocols.closing import Closing
from rsc_swarm.flight.busy import answer, busy_at
from rsc_swarm.flight.processes import how_ended
from rsc_swarm.machine.leaving import Leave, be_worker, nobody_asks

_LOOK_S = 0.1
_PATIENCE_S = 1.0  # for a policy to return, once the flight is to be left


def is_own(policy: str) -> bool:
    """Whether a mission names somebody's own class as its policy."""
    return ":" in policy


class Apart(Closing):
    """A process that makes something with which ``policy`` is flown, and calls its methods when it is told to."""

    def __init__(self, make: Callable[[], object], policy: str, leave: Leave) -> None:
        """Fork it, and wait until it has made that.

        Raises:
            PolicyError: as `call`; and whatever ``make`` raises.
        """
        self._policy, self._leave = policy, leave
        self._log = tempfile.NamedTemporaryFile()  # noqa: SIM115  where its stack goes, if it is asked for
        self._pipe, theirs = Pipe()
        sys.stdout.flush()
        with nobody_asks():
            self._pid = os.fork()
            if self._pid == 0:
                self._pipe.close()
                _serve(make, theirs, self._log.fileno())
        theirs.close()
        try:
            self._result()
        except BaseException:
            self.close()
            raise

    @property
    def ended(self) -> bool:
        return not self._pid

    def call(self, method: str, *given: object) -> Any:
        """What this method returns or raises there.

        Raises:
            PolicyStuck: asked to leave, and the policy does not return: soon, or asked again at once. PolicyError: the process
                has ended.
        """
        with suppress(OSError):  # it has ended; how is told below
            self._pipe.send((method, given))
        return self._result()

    def _result(self) -> Any:
        until = None
        while not select.select([self._pipe], [], [], _LOOK_S)[0]:
            if self._leave.asked and until is None:
                until = time.monotonic() + _PATIENCE_S
            if until is not None and (self._leave.again or time.monotonic() > until):
                self._give_up()
        try:
            result, error = self._pipe.recv()
        except (EOFError, OSError):
            raise PolicyError(f"policy {self._policy}: the process in which it flew {self._end()}") from None
        if error is not None:
            raise error
        return result

    def _give_up(self) -> NoReturn:
        place = busy_at(self._pid, Path(self._log.name))
        self.close()
        where = f" at {place}" if place else ""
        raise PolicyStuck(f"policy {self._policy} did not return: it was stopped{where}")

    def _end(self) -> str:
        _, status = os.waitpid(self._pid, 0)
        self._pid = 0
        return how_ended(os.waitstatus_to_exitcode(status))

    def close(self) -> None:
        """End it, whatever it is doing."""
        if self._pid:
            os.kill(self._pid, signal.SIGKILL)
            self._end()
        self._pipe.close()
        self._log.close()


def _serve(make: Callable[[], object], pipe: Connection, log: int) -> NoReturn:
    """Be the process: do what is asked for, until nobody asks any more."""
    code = 1
    try:
        be_worker()
        answer(log)
        thing = make()
        pipe.send((None, None))
        while True:
            method, given = pipe.recv()
            try:
                said: tuple[Any, Exception | None] = (getattr(thing, method)(*given), None)
            except Exception as error:
                said = (None, _told(error))
            pipe.send(said)
    except EOFError:
        code = 0
    except Exception as error:
        pipe.send((None, _told(error)))
    finally:
        sys.stdout.flush()
        os._exit(code)


def _told(error: Exception) -> Exception:
    """The error with where it was raised, which else would not go through a pipe."""
    error.add_note(traceback.format_exc())
    return error
