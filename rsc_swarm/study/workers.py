"""Many flights on many processes: batches of missions, every flight handed over the moment it ends.

The processes are a pool of ``concurrent.futures``; any other executor can stand in for it (rsc_swarm.study.machines). Ours are
forked once the kernels are loaded, so they start at once and share them. They ignore Ctrl-C: they leave as soon as nobody listens
any more.
"""

from collections.abc import Callable, Generator, Iterator
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor, as_completed, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import active_children, get_context
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Lock
from socket import gethostname
from typing import Any

from protocols.errors import BrokenError, SwarmError
from protocols.mission.document import Mission
from protocols.mission.policy_name import EXPERTS
from protocols.wire.status import SWAP_COUNTS
from rsc_swarm.batch.batch import Batch
from rsc_swarm.batch.expert import fly_expert
from rsc_swarm.flight.simulate import ROWS, Simulation, flights_at_once
from rsc_swarm.flight.warm_up import try_policy
from rsc_swarm.machine.leaving import be_worker, nobody_asks
from rsc_swarm.machine.limits import lacking
from rsc_swarm.study.fingerprint import fingerprint
from rsc_swarm.study.machines import Crew
from world.field import FieldError, draw_obstacles, draw_start
from world.invariants import Watched
from world.outcome import Outcome

Seeds = tuple[int, int]  # map seed, start seed
TASK = 64  # flights that an executor is given at a time, at most: some seconds to a minute of work
_TELL_EVERY = 50  # ticks
_LISTEN_S = 0.05
_FORK = get_context("fork")


@dataclass(frozen=True)
class Flight:
    """One flight of a batch: its seeds, how it ended, what the watch saw, and the swaps of all drones per SWAP_COUNTS."""

    map_seed: int
    seed: int
    outcome: Outcome
    watched: Watched
    swaps: dict[str, int]


class WorkerError(BrokenError, RuntimeError):
    """A worker died or could not fly; one line says why."""


# --- in a worker -------------------------------------------------------------------------------------------

_told: tuple[Connection, Lock] | None = None  # where this process tells what it flies; None: it returns it


def _enlist(reader: Connection, writer: Connection, lock: Lock) -> None:
    """Begin as a worker that tells through ``writer``; telling fails as soon as nobody has the other end any more."""
    global _told
    be_worker()
    reader.close()
    _told = writer, lock


def fly_seeds(mission: Mission, seeds: list[Seeds]) -> list[Flight]:
    """Fly ``mission`` once per pair of seeds, as many in step as fly best; the flights that were not told otherwise."""
    flights = []
    for batch in _batches(seeds, _in_step(mission)):
        for said in fly_batch(mission, batch):
            if _told:
                writer, lock = _told
                with lock:
                    writer.send(said)
            elif isinstance(said, Flight):
                flights.append(said)
    return flights


def _fly_task(code: str, mission: Mission, seeds: list[Seeds]) -> list[Flight]:
    """`fly_seeds` wherever that is, if it can be the same flights there: if ``mission`` has the `fingerprint` ``code``."""
    if fingerprint(mission) != code:
        raise WorkerError(
            f"worker {gethostname()} has other files of policy {mission.policy} than this command"
        )
    return fly_seeds(mission, seeds)


def _in_step(mission: Mission) -> int:
    return max(1, ROWS // mission.agents) if mission.policy in EXPERTS else flights_at_once(mission)


def _batches(seeds: list[Seeds], size: int) -> list[list[Seeds]]:
    return [seeds[first : first + size] for first in range(0, len(seeds), size)]


def _shared_out(seeds: list[Seeds], workers: int, most: int) -> list[list[Seeds]]:
    """At most so many at a time, so that in each round every worker flies as many."""
    rounds = -(-len(seeds) // (workers * most))
    return _batches(seeds, -(-len(seeds) // (workers * rounds)))


def fly_batch(mission: Mission, seeds: list[Seeds]) -> Iterator[Flight | int]:
    """Fly ``mission`` once per pair of seeds, all in step; yields flights as they end, and ticks flown.

    Raises:
        world.field.FieldError: one of the maps leaves no room to start.
    """
    for said in fly_together(_missions(mission, seeds)):
        yield said if isinstance(said, int) else said[1]


def fly_together(missions: list[Mission], both: bool = True) -> Iterator[tuple[int, Flight] | int]:
    """Fly missions that agree in all but seeds, obstacles and faults in step; yields flights as they end, each with the place of
    its mission, and ticks flown.

    Args:
        both: judge both successes (world.core.WorldCore).

    Raises:
        world.field.FieldError: one of the maps leaves no room to start.
    """
    seeds = [(mission.map_seed, mission.seed) for mission in missions]
    agents = missions[0].agents
    if missions[0].policy in EXPERTS:
        for said in fly_expert(missions, _TELL_EVERY):
            if isinstance(said, int):
                yield said
            else:
                world, ended, watched, swaps = said
                yield world, Flight(*seeds[world], ended, watched, swaps)
        return
    simulation = Simulation(missions, both=both)
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
                simulation.status(world * agents + agent, simulation.clock - 1).swaps
                for agent in range(agents)
            ]
            swaps = {
                name: sum(count) for name, count in zip(SWAP_COUNTS, zip(*counts, strict=True), strict=True)
            }
            yield world, Flight(*seeds[world], outcome, simulation.director.watched(world), swaps)


def _missions(mission: Mission, seeds: list[Seeds]) -> list[Mission]:
    missions = [mission.model_copy(update={"map_seed": map_seed, "seed": seed}) for map_seed, seed in seeds]
    for one in missions:
        try:
            draw_start(one, draw_obstacles(one))
        except FieldError as error:
            raise FieldError(f"map {one.map_seed}, seed {one.seed}: {error}") from None
    return missions


# --- who hires them ----------------------------------------------------------------------------------------


def fly_all(
    mission: Mission, seeds: list[Seeds], workers: int, executor: Executor | None = None
) -> Generator[Flight | int]:
    """`fly_batch` for many seeds on ``workers`` processes.

    Args:
        executor: flies instead of processes forked here; flights are then told when their batch has ended.

    Raises:
        WorkerError: a worker died or broke. protocols.mission.document.MissionError: the expert cannot fly this.
        world.field.FieldError: one of the maps leaves no room to start. agent.policy.PolicyError: the policy raised.
    """
    if not seeds:
        return
    with told_in_a_line():
        if executor:
            yield from _fly_elsewhere(executor, mission, seeds, workers)
        else:
            _rehearse(mission, seeds[0])
            batches = _shared_out(seeds, workers, _in_step(mission))
            yield from _fly_forked(mission, batches, min(workers, len(batches)))


@contextmanager
def told_in_a_line() -> Iterator[None]:
    """Whatever goes wrong with workers in this block becomes one line.

    Raises:
        WorkerError: a worker died or broke.
    """
    try:
        yield
    except SwarmError:
        raise
    except BrokenProcessPool:
        raise WorkerError("a worker died; run it again to go on") from None
    except CancelledError:
        raise WorkerError("the scheduler was lost; run it again to go on") from None
    except Exception as error:
        if not isinstance(error, ConnectionError | TimeoutError) and (lack := lacking(error)):
            raise WorkerError(f"{lack}; run it again to go on") from None
        raise WorkerError(
            f"a worker broke: {type(error).__name__}: {error}; run it again to go on"
        ) from error


def _fly_elsewhere(
    executor: Executor, mission: Mission, seeds: list[Seeds], workers: int
) -> Iterator[Flight | int]:
    """`fly_all` on an executor."""
    code, tasks = fingerprint(mission), _shared_out(seeds, workers, TASK)
    flying = [executor.submit(_fly_task, code, mission, task) for task in tasks]
    try:
        for future in as_completed(flying):
            flights: list[Flight] = future.result()
            yield sum(flight.outcome.ticks for flight in flights)
            yield from flights
    finally:  # nobody wants the rest any more
        for future in flying:
            future.cancel()


def _rehearse(mission: Mission, seeds: Seeds) -> None:
    """Load every kernel, but nothing that must not be forked."""
    missions = _missions(mission, [seeds])
    if mission.policy in EXPERTS:
        Batch(missions).fly(1)
    else:
        try_policy(mission.policy, lambda: Simulation(missions, rehearsal=True).tick())
        Simulation(missions, rehearsal=True).tick()


def _fly_forked(mission: Mission, batches: list[list[Seeds]], workers: int) -> Iterator[Flight | int]:
    reader, writer = _FORK.Pipe(duplex=False)
    try:
        with _forked(workers, _enlist, reader, writer, _FORK.Lock()) as pool:
            with nobody_asks():
                flying = {pool.submit(fly_seeds, mission, batch) for batch in batches}  # the first one forks
            writer.close()
            yield from _hear(reader, flying)
    finally:
        reader.close()


@contextmanager
def _forked(workers: int, begin: Callable[..., None], *given: Any) -> Iterator[ProcessPoolExecutor]:
    """A pool of forked processes. They are killed where the block raises: nobody wants the rest any more, and a policy that does
    not return would never leave."""
    pool = ProcessPoolExecutor(workers, _FORK, begin, given)
    others = active_children()
    try:
        yield pool
    except BaseException:
        for worker in set(active_children()).difference(others):
            worker.kill()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def executor_of(crew: Crew, mission: Mission) -> Iterator[Executor]:
    """An executor for the tasks of flights that are like ``mission``, on whoever the crew is.

    Raises:
        world.field.FieldError, agent.policy.PolicyError: the mission cannot be flown.
    """
    if crew.executor:
        yield crew.executor
        return
    _rehearse(mission, (mission.map_seed, mission.seed))
    with _forked(crew.workers, be_worker) as pool:
        with nobody_asks():
            pool.submit(int)  # the first one forks
        yield pool


def _hear(reader: Connection, flying: set[Future[list[Flight]]]) -> Iterator[Flight | int]:
    """What the workers tell until all batches have been flown."""
    while flying:
        patience = 0.0
        try:
            while reader.poll(_LISTEN_S):
                yield reader.recv()
        except EOFError:  # no worker is left
            patience = 10.0
        ended, flying = wait(flying, patience)
        for future in ended:
            future.result()
    while reader.poll():
        yield reader.recv()
