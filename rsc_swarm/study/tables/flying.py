"""Flying the rows of a table. What was flown stays in the folder, so that the same command goes on after a stop.

FOLDER/table-1.json, .csv, .md    the table as far as it is flown, written after every row
FOLDER/flights/                   journals of single flights; rows of two tables that fly the same share one
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from agent.policy import PolicyError
from protocols.mission.document import Mission, MissionError
from rsc_swarm.options import resolve
from rsc_swarm.study.evaluate import evaluate, summarise
from rsc_swarm.study.fingerprint import fingerprint
from rsc_swarm.study.finished import FinishedFlights, journal_path
from rsc_swarm.study.machines import Crew
from rsc_swarm.study.progress import TICKS_GUESS, Flights, Meter
from rsc_swarm.study.tables.plan_error import accuracy_of
from rsc_swarm.study.tables.result import RowResult, TableError, row_result
from rsc_swarm.study.tables.table import Row
from rsc_swarm.study.workers import Seeds


@dataclass(frozen=True)
class Job:
    """A row made ready: its mission, the fingerprint it flies under, where its flights are kept, and how many are missing."""

    row: Row
    mission: Mission
    code: str
    journal: Path
    missing: int

    @property
    def work(self) -> float:
        """How much is left to do, in drone-ticks."""
        return TICKS_GUESS * self.missing * self.mission.ticks * self.mission.agents


def prepare(rows: list[Row], seeds: list[Seeds], folder: Path) -> list[Job]:
    """Make every row ready before any is flown.

    Raises:
        MissionError: a row cannot be flown here. TableError: the folder cannot be made.
        rsc_swarm.study.finished.FinishedFlightsError: another command is writing there.
    """
    flights = folder / "flights"
    try:
        flights.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TableError(f"--out {folder}: cannot be made ({error.strerror})") from None
    return [_job(row, seeds, flights) for row in rows]


def _job(row: Row, seeds: list[Seeds], flights: Path) -> Job:
    try:
        mission = resolve(row.options)
        code = fingerprint(mission)
    except (MissionError, PolicyError) as error:
        raise MissionError(f"row {row.key} cannot be flown: {error}") from None
    path = journal_path(flights / f"{row.policy}.json", code)
    known = 0
    if path.exists():
        with FinishedFlights(path) as book:
            known = sum(pair in book.finished for pair in seeds)
    return Job(row, mission, code, path, len(seeds) - known)


def fly(
    jobs: list[Job],
    seeds: list[Seeds],
    starts: int,
    crew: Crew,
    meter: Meter,
    landed: Callable[[RowResult], None],
) -> None:
    """Fly all ``jobs``, showing them on one ``meter``; ``landed`` is told of each row as it is complete.

    Raises:
        rsc_swarm.study.workers.WorkerError, rsc_swarm.study.finished.FinishedFlightsError: as evaluate.
    """
    total = max(1.0, sum(job.work for job in jobs))
    done = 0.0
    for number, job in enumerate(jobs, 1):
        label = f"row {number} of {len(jobs)}, {job.row.key}: "
        guess = TICKS_GUESS * job.mission.ticks
        watcher = Flights(guess, meter, label, done / total, job.work / total)
        flown = evaluate(job.mission, seeds, crew, job.journal, watcher)
        done += job.work
        result = summarise(job.mission, flown, starts, job.code)
        landed(row_result(job.row, result, accuracy_of(job.mission, job.journal, seeds, crew.executor)))
