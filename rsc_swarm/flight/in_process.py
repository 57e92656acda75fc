"""One flight in this process, told to whoever watches: what ``rsc-swarm simulate`` runs.

The outcome is the same whatever is watched or recorded, and the same as ``rsc-swarm launch`` has in lockstep.
"""

import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

import numpy as np

from agent.policy.asking import is_within, left_behind
from agent.policy.base import NotReturned, PolicyError
from protocols.dynamics import TICK_S
from protocols.mission.document import Mission
from rsc_swarm.flight.simulate import Simulation
from rsc_swarm.machine.apart import Apart, LeftBehind
from rsc_swarm.machine.leaving import Leave, leave_when_asked
from world.outcome import Flown
from world.outlets.onlooker import Nobody, Onlooker
from world.outlets.recorder import Recorder
from world.outlets.snapshot import Snapshot, snapshot

_SHOW_EVERY_S = 1 / 8
_SHOW_TICKS = 200  # and at least this often
_LOOK_EVERY = 5  # ticks between two looks at the wall clock
_POLICY_S = 1.0  # for a policy to return, once the flight is to be left


def fly(
    mission: Mission,
    realtime: bool = False,
    on_snapshot: Callable[[Snapshot], None] | None = None,
    recorder: Recorder | None = None,
    went_wrong: Callable[[PolicyError], None] | None = None,
    onlooker: Onlooker | None = None,
) -> Flown:
    """Fly ``mission`` to its end.

    Ctrl-C ends the flight as interrupted; what was flown is told like any other. A policy that then does not return is stopped.

    Args:
        realtime: no faster than the wall clock.
        on_snapshot: called about 8 times a second, and once at the end.
        recorder: keeps every drone's path.
        went_wrong: told of a policy that went wrong in flight, which then ends as interrupted; left out: that is raised.
        onlooker: looks on, and may lay hands on the flight.

    Raises:
        world.field.FieldError, agent.policy.PolicyError: as Simulation.
    """
    simulation = Simulation([mission], watched=onlooker is not None)
    core, director = simulation.world, simulation.director
    wrong: PolicyError | None = None
    with _ways(mission) as (leave, do):
        first_tick_at, begin = time.time(), time.perf_counter()
        shown = -np.inf
        if recorder:
            recorder.record(core)
        looks_on = onlooker or Nobody()
        while core.active[0]:
            while (wait_s := looks_on.attend(director)) > 0 and not leave.asked:
                time.sleep(wait_s)
                begin += wait_s
            if leave.asked:
                director.leave()
            else:
                try:
                    do(director.tick)
                except PolicyError as error:
                    wrong = error
                    director.leave()
                if recorder and not wrong:
                    recorder.record(core)
            if director.clock % _LOOK_EVERY and core.active[0]:
                continue
            now = time.perf_counter() - begin
            if realtime and now < director.clock * TICK_S:
                time.sleep(director.clock * TICK_S - now)
            due = now - shown >= _SHOW_EVERY_S or director.clock % _SHOW_TICKS == 0
            if on_snapshot and (due or not core.active[0]):
                shown = now
                on_snapshot(snapshot(core, dict(simulation.farewell()), director.clock * TICK_S / now))
        looks_on.attend(director)
        flown = director.flown(time.perf_counter() - begin, first_tick_at)
    if wrong:
        if went_wrong is None:
            raise wrong
        went_wrong(wrong)
    return flown


def fly_together(missions: Sequence[Mission], recorders: Sequence[Recorder]) -> list[Flown]:
    """Fly missions that agree in all but seeds and obstacles in step, each to its own end: the flights that `fly` flies.

    Args:
        recorders: one per mission, for its world.

    Raises:
        world.field.FieldError, agent.policy.PolicyError: as Simulation.
    """
    simulation = Simulation(missions, telling=True)
    core, director = simulation.world, simulation.director
    flown: dict[int, Flown] = {}
    with _leave_even_a_policy() as leave:
        first_tick_at, begin = time.time(), time.perf_counter()
        for recorder in recorders:
            recorder.record(core)
        while core.active.any():
            flying, leaving = np.flatnonzero(core.active).tolist(), leave.asked
            ended = director.leave() if leaving else director.tick()
            for world in [] if leaving else flying:
                recorders[world].record(core)
            for world in ended:
                flown[world] = director.flown(time.perf_counter() - begin, first_tick_at, world=world)
    return [flown[world] for world in range(len(missions))]


@contextmanager
def _ways(mission: Mission) -> Iterator[tuple[Leave, Callable[[Callable[[], object]], object]]]:
    """Whether to leave, and how a tick is flown: with a policy of somebody's own so that it can be left behind."""
    if ":" not in mission.policy or threading.current_thread() is not threading.main_thread():
        with _leave_even_a_policy() as leave:
            yield leave, lambda work: work()
        return
    with leave_when_asked() as leave, Apart(leave, _POLICY_S) as apart:

        def do(work: Callable[[], object]) -> object:
            try:
                return apart.do(work)
            except LeftBehind as error:
                raise left_behind(mission.policy, error.frame) from None

        yield leave, do


@contextmanager
def _leave_even_a_policy() -> Iterator[Leave]:
    """As leave_when_asked; a policy that has not returned `_POLICY_S` after that, or when asked again, is raised into."""

    def hurry(_signal: int, frame: FrameType | None) -> None:
        if is_within(frame):
            raise NotReturned

    def ask(again: bool, frame: FrameType | None) -> None:
        signal.signal(signal.SIGALRM, hurry)
        signal.setitimer(signal.ITIMER_REAL, _POLICY_S, _POLICY_S)
        if again:
            hurry(signal.SIGALRM, frame)

    with leave_when_asked() as leave:
        before = signal.getsignal(signal.SIGALRM)
        leave.when_asked = ask
        try:
            yield leave
        finally:
            leave.when_asked = None
            if leave.asked and threading.current_thread() is threading.main_thread():
                signal.setitimer(signal.ITIMER_REAL, 0.0)
                signal.signal(signal.SIGALRM, before)
