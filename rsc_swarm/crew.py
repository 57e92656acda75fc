"""A crew of worker processes that fly batches of missions, and hand over every flight the moment it ends.

Workers are forked once the kernels are loaded, so they start at once. They ignore Ctrl-C: whoever hired them ends them.
"""

import os
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any

from protocols.mission import Mission
from protocols.status import SWAP_COUNTS
from rsc_swarm.simulate import Simulation
from world.core import Outcome

Seeds = tuple[int, int]  # map seed, start seed
_ROWS = 600  # drones flown in step by one worker: enough to spread the cost of a tick, few enough for the caches


@dataclass(frozen=True)
class Flight:
    """One flight of a batch: its seeds, how it ended, and the swaps of all its drones per SWAP_COUNTS."""

    map_seed: int
    seed: int
    outcome: Outcome
    swaps: dict[str, int]


class CrewError(RuntimeError):
    """A worker died or could not fly; one line says which and why."""


def fly_batch(mission: Mission, seeds: list[Seeds]) -> Iterator[Flight]:
    """Fly ``mission`` once per pair of seeds, all in step; yields flights as they end.

    Raises:
        world.field.FieldError: one of the maps leaves no room to start.
    """
    simulation = Simulation([mission.model_copy(update={"map_seed": map_seed, "seed": seed}) for map_seed, seed in seeds])
    agents = mission.agents
    while simulation.world.active.any():
        for world in simulation.tick():
            outcome = simulation.world.outcomes[world]
            assert outcome is not None
            counts = [party.counts for party in simulation.agents.parties.party[world * agents : (world + 1) * agents]]
            swaps = {name: sum(getattr(count, name) for count in counts) for name in SWAP_COUNTS}
            yield Flight(*seeds[world], outcome, swaps)


def fly_all(mission: Mission, seeds: list[Seeds], workers: int) -> Iterator[Flight]:
    """Fly ``mission`` once per pair of seeds on ``workers`` processes; yields flights as they end, in no order.

    Raises:
        CrewError: a worker died, or a mission could not be flown.
    """
    size = max(1, min(_ROWS // mission.agents, -(-len(seeds) // workers)))
    batches = [seeds[first : first + size] for first in range(0, len(seeds), size)]
    if not batches:
        return
    Simulation([mission]).tick()  # loads every kernel before the fork
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
                if isinstance(said, Flight):
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
        self._process = context.Process(target=_work, args=(theirs, mission), name=f"flyer-{number}", daemon=True)
        self._process.start()
        theirs.close()

    def hear(self) -> Any:
        """What the worker says next: a flight, or None for the end of its batch."""
        try:
            said = self.pipe.recv()
        except (EOFError, ConnectionResetError):
            self._process.join(1.0)
            raise CrewError(f"worker {self.number} died (exit code {self._process.exitcode}); run it again to go on") from None
        if isinstance(said, str):
            raise CrewError(said)
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
                for flight in fly_batch(mission, batch):
                    pipe.send(flight)
            except Exception as error:
                seeds = f"maps {min(batch)[0]} to {max(batch)[0]}"
                pipe.send(f"{seeds}: {type(error).__name__}: {' '.join(str(error).split())}")
                return
            pipe.send(None)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return  # nobody listens any more
