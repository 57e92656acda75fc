"""Whether a table still is what comes out: a sample of the flights of each row is flown again and compared."""

from dataclasses import dataclass

from protocols.errors import SwarmError
from rsc_swarm.options import resolve
from rsc_swarm.study.evaluate import STARTS_PER_MAP, evaluate, seeds_of
from rsc_swarm.study.machines import Crew
from rsc_swarm.study.tables.result import RowResult, TableResult, command_of
from rsc_swarm.study.tables.rows import TABLES
from rsc_swarm.study.workers import Seeds


@dataclass(frozen=True)
class Standing:
    """A row, and the table in which it stands."""

    table: str
    row: RowResult

    @property
    def key(self) -> str:
        """Of the row."""
        return self.row.key


@dataclass(frozen=True)
class Verified:
    """So many flights of a row were flown again; what came out differently, a line each."""

    flown: int
    differences: tuple[str, ...]


def standing(tables: list[TableResult]) -> list[Standing]:
    """All rows of ``tables``."""
    return [Standing(table.table, row) for table in tables for row in table.rows]


def sample(row: RowResult, count: int) -> list[Seeds]:
    """Up to ``count`` flights of ``row``, always the same ones: half of them failed ones, if there are so many, the rest not."""
    first, last = row.maps
    failed = {seed for seeds in row.failures.values() for seed in seeds}
    seeds = seeds_of(first, last - first + 1, row.starts)
    lost = [pair for pair in seeds if pair[1] in failed]
    won = [pair for pair in seeds if pair[1] not in failed]
    some = _spread(lost, max(count // 2, count - len(won)))
    return sorted([*some, *_spread(won, count - len(some))])


def _spread(seeds: list[Seeds], count: int) -> list[Seeds]:
    """``count`` of them, evenly spread; all if there are no more."""
    step = max(1.0, len(seeds) / max(1, count))
    return [seeds[int(place * step)] for place in range(min(count, len(seeds)))]


def verify(stands: Standing, count: int, crew: Crew) -> Verified:
    """Fly a `sample` of a row again.

    Raises:
        SwarmError: as rsc_swarm.study.evaluate.evaluate.
    """
    row, known = stands.row, {one.key: one for one in TABLES[stands.table].rows}
    if row.key not in known:
        return Verified(0, ("is no row of this version",))
    options = known[row.key].options
    if (command := command_of(options, row.maps, row.starts)) != row.command:
        return Verified(0, (f"is flown by another command now: {command}",))
    try:
        mission = resolve(options)
    except SwarmError as error:
        return Verified(0, (f"cannot be flown: {error}",))
    said = {seed: failure for failure, seeds in row.failures.items() for seed in seeds}
    flights = evaluate(mission, sample(row, count), crew)
    differences = [
        f"map {flight.seed // STARTS_PER_MAP}, seed {flight.seed}: {now or 'success'} now, "
        f"{before or 'success'} in the table"
        for flight in flights
        if (now := flight.outcome.failure) != (before := said.get(flight.seed))
    ]
    return Verified(len(flights), tuple(differences))
