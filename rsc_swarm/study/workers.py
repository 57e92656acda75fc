"""A crew of worker processes that fly batches of missions, and hand over every flight the moment it ends.

Workers are forked once the kernels are loaded, so they start at once. They ignore Ctrl-C: whoever hired them
ends them.
"""

import os
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any

from agent.policy import PolicyError
from protocols.errors import BrokenError
from protocols.mission.document import Mission
from protocols.wire.status import SWAP_COUNTS
from rsc_swarm.batch.batch import Batch
from rsc_swarm.batch.expert import EXPERT, fly_expert
from rsc_swarm.flight.simulate import Simulation
from world.core import Outcome
from world.field import FieldError, draw_obstacles, draw_start
from world.invariants import Watched

Seeds = tuple[int, int]  # map seed, start seed
_TELL_EVERY = 50  # ticks
# Drones flown in step by one worker: more would be no faster, and flights would end in larger bunches.
_ROWS = 150


@dataclass(frozen=True)
class Flight:
    """One flight of a batch: its seeds, how it ended, what the watch saw, and the swaps of all drones per SWAP_COUNTS."""

    map_seed: int
    seed: int
    outcome: Outcome
    watched: Watched
    swaps: dict[str, int]


class WorkerError(BrokenError, RuntimeError):
    """A worker died or could not fly; one line says which and why."""


def fly_batch(mission: Mission, seeds: list[Seeds]) -> Iterator[Flight | int]:
    """Fly ``mission`` once per pair of seeds, all in step; yields flights as they end, and ticks flown.

    Raises:
        world.field.FieldError: one of the maps leaves no room to start.
    """
    if mission.policy == EXPERT:
        for said in fly_expert(_missions(mission, seeds), _TELL_EVERY):
            if isinstance(said, int):
                yield said
            else:
                world, ended, watched, swaps = said
                yield Flight(*seeds[world], ended, watched, swaps)
        return
    simulation = Simulation(_missions(mission, seeds))
    agents = mission.agents
    flown = 0
    while simulation.world.active.any():
        flown += int(simulation.world.active.sum())
        if simulation.clock % _TELL_EVERY == 0:
            yield flown
            flown = 0
        for world in simulation.tick():
            outcome = simulation.world.outcomes[world]
            assert outcome is not None
            counts = [
                party.counts
                for party in simulation.agents.endpoints.endpoint[world * agents : (world + 1) * agents]
            ]
            swaps = {name: sum(getattr(count, name) for count in counts) for name in SWAP_COUNTS}
            yield Flight(*seeds[world], outcome, simulation.watches[world].result(), swaps)


def _missions(mission: Mission, seeds: list[Seeds]) -> list[Mission]:
    missions = [mission.model_copy(update={"map_seed": map_seed, "seed": seed}) for map_seed, seed in seeds]
    for one in missions:
        try:
            draw_start(one, draw_obstacles(one))
        except FieldError as error:
            raise FieldError(f"map {one.map_seed}, seed {one.seed}: {error}") from None
    return missions


def _rehearse(mission: Mission, seeds: Seeds) -> None:
    """Load every kernel, but nothing that must not be forked."""
    missions = _missions(mission, [seeds])
    if mission.policy == EXPERT:
        Batch(missions).fly(1)
    else:
        Simulation(missions, rehearsal=True).tick()


def fly_all(mission: Mission, seeds: list[Seeds], workers: int) -> Iterator[Flight | int]:
    """`fly_batch` for many seeds on ``workers`` processes.

    Raises:
        WorkerError: a worker died or broke. protocols.mission.document.MissionError: the expert cannot fly this.
        world.field.FieldError: one of the maps leaves no room to start. agent.policy.PolicyError: the policy raised.
    """
    size = max(1, min(_ROWS // mission.agents, -(-len(seeds) // workers)))
    batches = [seeds[first : first + size] for first in range(0, len(seeds), size)]
    if not batches:
        return
    _rehearse(mission, seeds[0])
    crew = [_Worker(mission, number) for number in range(min(workers, len(batches)))]
    try:
        for worker in crew:
            worker.pipe.send(batches.pop(0))
        busy = {worker.pipe: worker for worker in crew}
        while busy:
            for pipe in wait(list(busy)):
                assert isinstance(pipe, Connection)
                worker = busy[pipe]
                said = worker.hear()
                if said is not None:
                    yield said
                elif batches:
                    pipe.send(batches.pop(0))
                else:
                    del busy[pipe]
    finally:
        for worker in crew:
            worker.dismiss()


class _Worker:
    def __init__(self, mission: Mission, number: int) -> None:
        context = get_context("fork")
        self.pipe, theirs = context.Pipe()
        self.number = number
        self._process = context.Process(
            target=_work, args=(theirs, mission), name=f"flyer-{number}", daemon=True
        )
        self._process.start()
        theirs.close()

    def hear(self) -> Any:
        """What the worker says next: a flight, ticks flown, or None for the end of its batch."""
        try:
            said = self.pipe.recv()
        except (EOFError, ConnectionResetError):
            self._process.join(1.0)
            raise WorkerError(
                f"worker {self.number} died (exit code {self._process.exitcode}); run it again to go on"
            ) from None
        if isinstance(said, Exception):
            raise said
        if isinstance(said, str):
            raise WorkerError(f"worker {self.number} broke: {said}")
        return said

    def dismiss(self) -> None:
        self.pipe.close()
        self._process.terminate()
        self._process.join()


def _work(pipe: Connection, mission: Mission) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    parent = os.getppid()
    try:
        while True:
            while not pipe.poll(1.0):
                if os.getppid() != parent:
                    return
            batch: list[Seeds] = pipe.recv()
            try:
                for said in fly_batch(mission, batch):
                    pipe.send(said)
                    if os.getppid() != parent:
                        return
            except (FieldError, PolicyError) as error:
                pipe.send(error)
                return
            except Exception as error:
                pipe.send(f"{type(error).__name__}: {' '.join(str(error).split())}")
                return
            pipe.send(None)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return  # nobody listens any more
