"""Compile the rules ahead, and tell how far that has come: a first flight has nothing else to show for a while."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from agent.policy import learned  # noqa: F401  its rules count, too
from agent.process import rehearse
from protocols.kernels import Kernel, compiling_watched
from protocols.mission.document import Mission, parse_mission
from rsc_swarm.flight.simulate import Simulation
from rsc_swarm.show.progress import Meter
from world.server.questions import Questions, empty_frames

_PACKAGES = ("protocols", "agent", "world", "rsc_swarm")


def compile_flight() -> None:
    """Compile what a flight of the learned policy needs, as far as it is not kept on disk already."""
    with _counting():
        _fly(_mission())
        rehearse(_mission())


def compile_all() -> None:
    """Compile what flights, evaluations and trainings need, as far as it is not kept on disk already."""
    from agent.policy import analytic, saber  # noqa: F401  their rules count, too
    from rsc_swarm.batch.batch import Batch

    with _counting():
        for policy in ("rsc-h20", "analytic", "saber"):
            _fly(_mission(policy=policy))
        rehearse(_mission())
        batch = Batch([_mission(faults=[])])
        batch.fly(1)
        batch.label(1)


def _mission(**fields: Any) -> Mission:
    """A small flight: the rules are the same for any number of drones. Those of lost ones need one that is lost."""
    return parse_mission({"agents": 4, "faults": [{"at_s": 0.01, "kind": "kill", "slots": [2]}], **fields})


def _fly(mission: Mission) -> None:
    flight = Simulation([mission], rehearsal=True)
    for _ in range(3):
        flight.tick()
    world = flight.world
    Questions(world, empty_frames(world)).write(0, 0, world.rows_awake, [0] * mission.agents)


@contextmanager
def _counting() -> Iterator[None]:
    """Show on a bar how many of the loaded modules' rules are compiled, before anything else can be shown."""
    counter = _Counter(len(_loaded()))
    try:
        with compiling_watched(counter.compiled):
            yield
    finally:
        counter.close()


def _loaded() -> set[int]:
    """The rules of all modules that are loaded and that no other of them calls, by id."""
    modules = [module for name, module in sys.modules.items() if name.split(".")[0] in _PACKAGES]
    rules = [rule for module in modules for rule in vars(module).values() if _is_rule(rule)]
    called = {name for rule in rules for name in rule.py_func.__code__.co_names}
    return {id(rule) for rule in rules if not rule.inlined and rule.__name__ not in called}


def _is_rule(thing: Any) -> bool:
    return isinstance(thing, Kernel) and thing.is_ours


class _Counter:
    """Counts on a bar which rules are compiled."""

    def __init__(self, total: int) -> None:
        self._total, self._ready, self._meter = total, 0, Meter()
        self._meter.begin(self._text(), total)
        self._meter.draw(0, self._text())

    def compiled(self, rule: Kernel) -> None:
        """A rule is compiled."""
        self._ready += 1
        if self._meter.due():
            self._meter.draw(self._ready, self._text())

    def close(self) -> None:
        """Take the bar away."""
        self._meter.close()

    def _text(self) -> str:
        return f"compiling the rules: {self._ready} of {self._total}"
