"""Compile the rules ahead, and tell how far that has come: a first flight has nothing else to show for a while.

Compiling takes place in processes of its own, side by side, and is kept on disk: what it leaves in memory goes with them.
"""

import gc
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from agent.policy import learned  # noqa: F401  its rules count, too
from agent.process import rehearse
from protocols.dynamics import TICK_S, integrate
from protocols.kept import cache_folder
from protocols.kernels import Kernel, compiling_watched
from protocols.mission.document import Mission, parse_mission
from protocols.wire.status import AgentStatus
from rsc_swarm.flight.simulate import Simulation
from rsc_swarm.machine.leaving import be_worker, nobody_asks
from rsc_swarm.show.progress import Meter
from world.core import Answers, Inbox, WorldCore
from world.director import Director, Swarm
from world.faults import Event
from world.outlets.judged import findings_of
from world.outlets.recorder import Recorder
from world.server.questions import Questions
from world.server.said import Said

_PACKAGES = ("protocols", "agent", "world", "rsc_swarm")
_TICKS = 3

Job = Callable[[], None]


def compile_flight() -> None:
    """Compile what a flight of the learned policy needs, as far as it is not kept on disk already."""
    _compile([_be_a_drone, _be_the_world], [_fly])


def compile_all() -> None:
    """Compile what flights, evaluations and trainings need, as far as it is not kept on disk already."""
    from agent.policy import analytic, saber  # noqa: F401  their rules count, too
    from rsc_swarm.batch.batch import Batch

    def fly_a_batch() -> None:
        batch = Batch([_mission(faults=[])])
        batch.fly(1)
        batch.label(1)

    def be_a_drone_then_a_batch() -> None:  # they share parts, which are then made ready once
        _be_a_drone()
        fly_a_batch()

    def be_other_drones() -> None:
        _be_a_drone("analytic")
        _be_a_drone("saber")

    _compile([be_a_drone_then_a_batch, _be_the_world], [_fly, be_other_drones])


# --- what calls all rules ----------------------------------------------------------------------------------


def _mission(**fields: Any) -> Mission:
    """A small flight: the rules are the same for any number of drones. Those of lost ones need one that is lost."""
    return parse_mission({"agents": 4, "faults": [{"at_s": 0.01, "kind": "kill", "slots": [2]}], **fields})


def _be_a_drone(policy: str = "rsc-h20") -> None:
    rehearse(_mission(policy=policy))


def _be_the_world() -> None:
    mission = _mission()
    core, recorder = WorldCore([mission]), Recorder(mission)
    director = Director(core, _Idle(core))
    for _ in range(_TICKS):
        director.tick()
        recorder.record(core)
    findings_of(recorder.trajectory, mission)
    integrate((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), 1.0, 1.0, TICK_S)  # of a vehicle that is led
    Questions(core, Said(core).frames)


def _fly(policy: str = "rsc-h20") -> None:
    flight = Simulation([_mission(policy=policy)], rehearsal=True)
    for _ in range(_TICKS):
        flight.tick()


class _Idle(Swarm):
    """Does nothing."""

    def __init__(self, core: WorldCore) -> None:
        rows = core.shape[0] * core.shape[1]
        self._said = Answers(np.zeros((rows, 2)), np.zeros(rows, np.int64), np.arange(rows))

    def strike(self, event: Event) -> None:
        pass

    def ask(self, tick: int, inbox: Inbox) -> Answers:
        return self._said

    def struck_off(self, row: int) -> None:
        pass

    def farewell(self) -> list[tuple[int, AgentStatus]]:
        return []


# --- in processes ------------------------------------------------------------------------------------------


def _compile(*turns: Sequence[Job]) -> None:
    """Do the jobs of each turn side by side, one turn after the other; what fails elsewhere is done, or raised, here."""
    with _Bar(_loaded()) as bar:
        for jobs in turns:
            if cache_folder() is None or not _side_by_side(jobs, bar):
                for job in jobs:
                    with _telling(bar.ready):
                        job()


def _side_by_side(jobs: Sequence[Job], bar: "_Bar") -> bool:
    """Whether all went well."""
    context = get_context("fork")
    reader, writer = context.Pipe(duplex=False)
    workers = [context.Process(target=_work, args=(job, reader, writer)) for job in jobs]
    with nobody_asks():
        for worker in workers:
            worker.start()
    writer.close()
    try:
        while True:
            bar.ready(reader.recv_bytes().decode())
    except EOFError:  # all have left
        pass
    finally:
        reader.close()
    for worker in workers:
        worker.join()
    return all(worker.exitcode == 0 for worker in workers)


def _work(job: Job, reader: Connection, writer: Connection) -> None:
    be_worker()
    reader.close()
    try:
        with _telling(lambda name: writer.send_bytes(name.encode())):
            job()
    except Exception:  # whoever waits does it again, and finds out
        sys.exit(1)


@contextmanager
def _telling(ready: Callable[[str], None]) -> Iterator[None]:
    """Call this with the name of each rule that is compiled. To look for garbage meanwhile would take a quarter of the time."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        with compiling_watched(lambda rule: ready(_name_of(rule))):
            yield
    finally:
        if collecting:
            gc.enable()


def _loaded() -> set[str]:
    """The names of the rules of all modules that are loaded and that no other of them calls."""
    modules = [module for name, module in sys.modules.items() if name.split(".")[0] in _PACKAGES]
    rules = [rule for module in modules for rule in vars(module).values() if _is_rule(rule)]
    called = {name for rule in rules for name in rule.py_func.__code__.co_names}
    return {_name_of(rule) for rule in rules if not rule.inlined and rule.__name__ not in called}


def _name_of(rule: Kernel) -> str:
    return f"{rule.__module__}.{rule.__name__}"


def _is_rule(thing: Any) -> bool:
    return isinstance(thing, Kernel) and thing.is_ours


class _Bar:
    """Counts the rules that are compiled; shown before anything else can be. A rule may be compiled more than once, and counts
    once."""

    def __init__(self, rules: set[str]) -> None:
        self._missing, self._total, self._meter = rules, len(rules), Meter()

    def __enter__(self) -> "_Bar":
        self._meter.begin(self._text(), self._total)
        self._meter.draw(0, self._text())
        return self

    def __exit__(self, *_: object) -> None:
        self._meter.close()

    def ready(self, name: str) -> None:
        """This rule is compiled."""
        self._missing.discard(name)
        if self._meter.due():
            self._meter.draw(self._total - len(self._missing), self._text())

    def _text(self) -> str:
        return f"compiling the rules: {self._total - len(self._missing)} of {self._total}"
