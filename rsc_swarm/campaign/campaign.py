"""A campaign: many flights in which things go wrong; what broke, shrunk, kept and grouped.

What was flown stays in the folder, a line per task, so that the same command goes on after a stop, and one for more flights flies
only what is missing.
"""

from collections.abc import Iterator
from concurrent.futures import Executor, Future, as_completed
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any, Protocol, TypeVar

from pydantic import TypeAdapter, ValidationError

from rsc_swarm.campaign.flying import Failure, Plan, Tally, fly_task
from rsc_swarm.campaign.kept import KeptError
from rsc_swarm.campaign.shrinking import shrink
from rsc_swarm.study.fingerprint import fingerprint, name_of
from rsc_swarm.study.finished import JOURNAL, Journal
from rsc_swarm.study.machines import Crew
from rsc_swarm.study.workers import executor_of, told_in_a_line

_T = TypeVar("_T")
_V = TypeVar("_V")
SHRUNK = 3  # failures of each name that are shrunk: the others are like them


@dataclass(frozen=True)
class Group:
    """Failures with one name, the shortest first."""

    name: str
    failures: tuple[Failure, ...]


@dataclass(frozen=True)
class _Line:
    """A task that has been flown, or (without a tally) a failure that has been shrunk."""

    task: int
    size: int
    tally: Tally | None = None
    shrunk: Failure | None = None
    digest: str = ""  # of the flight that was shrunk


_LINE = TypeAdapter(_Line)


class Told(Protocol):
    """Who is told how it goes on."""

    def __call__(self, tally: Tally, shrinking: int, /) -> None:
        """So far; and how many failures are being shrunk."""


class FlownTasks(Journal[tuple[int, int, str], _Line]):
    """The finished tasks of one plan, flown by one code, and what was shrunk: ``tasks`` by number, ``shrunk`` by digest."""

    def __init__(self, folder: Path, plan: Plan) -> None:
        """Open or make it.

        Raises:
            KeptError: the folder cannot be used. FinishedFlightsError: as `Journal`.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise KeptError(f"--out {folder}: cannot be used ({error.strerror})") from None
        code = name_of(fingerprint(plan.mission), plan.budget, plan.seed)
        super().__init__(folder / f"{code}{JOURNAL}")
        lines = self.finished.values()
        self.tasks = {
            line.task: line.tally
            for line in lines
            if line.tally and line.task < plan.tasks and line.size == plan.size(line.task)
        }
        self.shrunk = {line.digest: line.shrunk for line in lines if line.shrunk}

    @staticmethod
    def _key(record: _Line) -> tuple[int, int, str]:
        return record.task, record.size, record.digest

    @staticmethod
    def _parse(line: str) -> _Line | None:
        try:
            return _LINE.validate_json(line)
        except ValidationError:
            return None

    @staticmethod
    def _fields(record: _Line) -> dict[str, Any]:
        fields: dict[str, Any] = _LINE.dump_python(record, mode="json")
        return fields

    def flown(self, task: int, size: int, tally: Tally) -> None:
        """Keep a task that has been flown.

        Raises:
            FinishedFlightsError: the disk is full, say.
        """
        self.tasks[task] = tally
        self.add(_Line(task, size, tally))

    def shortened(self, failure: Failure, shrunk: Failure) -> None:
        """Keep what a failure was shrunk to.

        Raises:
            FinishedFlightsError: as `flown`.
        """
        self.shrunk[failure.digest] = shrunk
        self.add(_Line(failure.task, 0, shrunk=shrunk, digest=failure.digest))

    def tally(self) -> Tally:
        """What the tasks add up to, in their order, whichever ended first."""
        total = Tally()
        for _, flown in sorted(self.tasks.items()):
            total.add(flown)
        return total

    def unshrunk(self) -> list[Failure]:
        """The failures that are still to be shrunk."""
        return [failure for failure in _first_of_each(self.tally()) if failure.digest not in self.shrunk]


def fly(plan: Plan, crew: Crew, folder: Path, told: Told) -> Tally:
    """Fly what is missing, then shrink what broke: `SHRUNK` failures of each name.

    Raises:
        WorkerError: a worker died or could not fly. KeptError, FinishedFlightsError: the folder cannot be used.
        agent.policy.PolicyError: the policy raised.
    """
    with FlownTasks(folder, plan) as journal:
        told(journal.tally(), 0)
        missing = [task for task in range(plan.tasks) if task not in journal.tasks]
        if missing or journal.unshrunk():
            with told_in_a_line(), executor_of(crew, plan.mission) as executor:
                _fly_missing(plan, missing, journal, executor, told)
                _shrink_found(plan, journal, executor, told)
        return _with_shrunk(journal)


def _fly_missing(plan: Plan, missing: list[int], journal: FlownTasks, executor: Executor, told: Told) -> None:
    flying = {executor.submit(fly_task, plan, task): task for task in missing}
    so_far = journal.tally()  # to add all up anew after each task would take longer from task to task
    for future in _ended(flying):
        task, flown = flying[future], future.result()
        journal.flown(task, plan.size(task), flown)
        so_far.add(flown)
        told(so_far, 0)


def _shrink_found(plan: Plan, journal: FlownTasks, executor: Executor, told: Told) -> None:
    tally, todo = journal.tally(), journal.unshrunk()
    told(tally, len(todo))
    shrinking = {executor.submit(shrink, plan, failure): failure for failure in todo}
    for left, future in enumerate(_ended(shrinking), 1):
        journal.shortened(shrinking[future], future.result())
        told(tally, len(todo) - left)


def _ended(flying: dict[Future[_T], _V]) -> Iterator[Future[_T]]:
    try:
        yield from as_completed(flying)
    finally:  # nobody wants the rest any more
        for future in flying:
            future.cancel()


def _first_of_each(tally: Tally) -> Iterator[Failure]:
    """The failures to shrink: of each name those with the fewest faults."""
    return chain.from_iterable(group.failures[:SHRUNK] for group in groups(tally))


def _with_shrunk(journal: FlownTasks) -> Tally:
    tally = journal.tally()
    failures = [journal.shrunk.get(failure.digest, failure) for failure in tally.failures]
    return replace(tally, failures=failures)


def groups(tally: Tally) -> list[Group]:
    """The failures by what broke: safety first, then by how many they are."""
    by_name: dict[str, list[Failure]] = {}
    for failure in tally.failures:
        by_name.setdefault(failure.broken.name, []).append(failure)
    found = [Group(name, tuple(sorted(some, key=_length))) for name, some in by_name.items()]
    return sorted(found, key=lambda group: (not group.failures[0].broken.safety, -len(group.failures)))


def _length(failure: Failure) -> tuple[bool, int, int, int]:
    mission = failure.mission
    return not failure.shrunk, len(mission.faults), mission.map_seed, mission.seed
