"""A policy of somebody's own, flown in a process of its own: whoever is asked to leave can end it, whatever it is doing.

The world stays here, and with it all that has been flown. The process is forked, what it is told and what it answers goes through
a pipe, and it ends with the one that forked it. Whoever must fork or fly such a policy himself first has it tried apart.
"""

import os
import select
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from agent.policy.base import PolicyError, PolicyStuck
from protocols.closing import Closing
from protocols.mission.document import Mission
from protocols.wire.status import AgentStatus
from rsc_swarm.flight.busy import answer, busy_at
from rsc_swarm.flight.simulate import Simulation
from rsc_swarm.machine.leaving import Leave, be_worker, leave_when_asked, nobody_asks
from world.core import Answers, Inbox, WorldCore
from world.director import Director, Swarm
from world.faults import Event

_LOOK_S = 0.1
_PATIENCE_S = 1.0  # for a policy to return, once the flight is to be left


def is_own(policy: str) -> bool:
    """Whether a mission names somebody's own class as its policy."""
    return ":" in policy


class DronesApart(Closing):
    """The drones of one flight: a swarm (world.director.Swarm)."""

    def __init__(self, world: WorldCore, leave: Leave, rehearsal: bool = False) -> None:
        """The drones of this world's flight, whose policy may be left; rehearsal: as `Simulation`.

        Raises:
            PolicyError, KeyboardInterrupt: as `Apart`.
        """
        (mission,) = world.missions
        self._world, self._clock = world, 0
        self._apart = Apart(partial(_Followed, mission, rehearsal), mission.policy, leave)

    def strike(self, event: Event) -> None:
        self._apart.call("strike", self._now(), event)

    def struck_off(self, row: int) -> None:
        """It is asked no more, and that is all."""

    def ask(self, tick: int, inbox: Inbox) -> Answers:
        said: Answers = self._apart.call("ask", self._now(), inbox.arrived)
        self._clock = tick + 1
        return said

    def farewell(self) -> list[tuple[int, AgentStatus]]:
        """The last accounts of all drones that fly and answer; of none if their process is gone."""
        if self._apart.ended:
            return []
        said: list[tuple[int, AgentStatus]] = self._apart.call("farewell", self._now())
        return said

    def _now(self) -> "_Now":
        return self._clock, _changing(self._world)

    def close(self) -> None:
        self._apart.close()


_Now = tuple[int, tuple[NDArray[Any], ...]]  # the clock, and what `_changing` says


def _changing(world: WorldCore) -> tuple[NDArray[Any], ...]:
    """All of a world that drones look at and that changes."""
    return (world.flying, world.responsive, world.active, world.inbox_start, *world.sensed)


class _Followed:
    """The other end: a simulation whose world does as it is told."""

    def __init__(self, mission: Mission, rehearsal: bool) -> None:
        self._simulation = Simulation([mission], rehearsal)

    def _follow(self, now: _Now) -> Simulation:
        self._simulation.director.clock, there = now
        for mine, theirs in zip(_changing(self._simulation.world), there, strict=True):
            mine[...] = theirs
        return self._simulation

    def strike(self, now: _Now, event: Event) -> None:
        self._follow(now).strike(event)

    def ask(self, now: _Now, arrived: NDArray[np.int32]) -> Answers:
        simulation = self._follow(now)
        return simulation.ask(simulation.clock, Inbox(simulation.world.inbox_start, arrived))

    def farewell(self, now: _Now) -> list[tuple[int, AgentStatus]]:
        return self._follow(now).farewell()


@contextmanager
def flown_by(
    mission: Mission, leave: Leave, rehearsal: bool = False, watched: bool = False
) -> Iterator[tuple[Director, Swarm]]:
    """Who flies a mission in this process, with a policy of somebody's own apart; the arguments are those of `Simulation`.

    Raises:
        world.field.FieldError, PolicyError: it cannot be flown. KeyboardInterrupt: asked to leave meanwhile.
    """
    if not is_own(mission.policy):
        simulation = Simulation([mission], rehearsal, watched=watched)
        yield simulation.director, simulation
        return
    world = WorldCore([mission], watched)
    with DronesApart(world, leave, rehearsal) as drones:
        yield Director(world, drones), drones


def warm_up(mission: Mission) -> None:
    """Load (or on the very first run compile) every kernel that flying ``mission`` needs; what must not be forked stays closed.

    Raises:
        world.field.FieldError, PolicyError: it cannot be flown. KeyboardInterrupt: asked to leave meanwhile.
    """
    with (
        _may_leave() as leave,
        flown_by(mission.model_copy(update={"faults": ()}), leave, True) as (director, _),
    ):
        director.tick()


def try_policy(policy: str, rehearse: Callable[[], object]) -> None:
    """Rehearse where it can be left, if this is a policy of somebody's own, before this process does.

    Raises:
        PolicyError, KeyboardInterrupt: as `Apart`; and whatever ``rehearse`` raises.
    """
    if is_own(policy):
        with _may_leave() as leave, Apart(rehearse, policy, leave):
            pass


@contextmanager
def _may_leave() -> Iterator[Leave]:
    """As leave_when_asked, where there is nothing to tell or keep yet."""
    with leave_when_asked() as leave:
        yield leave
    if leave.asked:
        raise KeyboardInterrupt


class Apart(Closing):
    """A process that makes something with which ``policy`` is flown, and calls its methods when it is told to."""

    def __init__(self, make: Callable[[], object], policy: str, leave: Leave) -> None:
        """Fork it, and wait until it has made that.

        Raises:
            PolicyError, KeyboardInterrupt: as `call`; and whatever ``make`` raises.
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
            PolicyStuck: asked to leave, and the policy does not return: soon, or asked again at once.
            KeyboardInterrupt: so it was not the policy that took so long. PolicyError: the process has ended.
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
        if place is None:
            raise KeyboardInterrupt
        raise PolicyStuck(f"policy {self._policy} did not return: it was stopped at {place}")

    def _end(self) -> str:
        _, status = os.waitpid(self._pid, 0)
        self._pid = 0
        code = os.waitstatus_to_exitcode(status)
        return f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"

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
