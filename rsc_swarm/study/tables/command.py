"""``rsc-swarm evaluate --table`` and ``rsc-swarm tables``: fly a table, write and print it."""

import sys
from contextlib import closing
from pathlib import Path

from protocols.mission.document import MissionError
from rsc_swarm.cli.options import MissionOptions, chosen, flag
from rsc_swarm.show.progress import Gauge
from rsc_swarm.show.render import console
from rsc_swarm.study.evaluate import crew_size, seeds_of
from rsc_swarm.study.tables import rows as tables
from rsc_swarm.study.tables.flying import fly, prepare
from rsc_swarm.study.tables.markdown import drawn, markdown, page
from rsc_swarm.study.tables.result import (
    RowResult,
    TableResult,
    merged,
    path_of,
    read_table,
    read_tables,
    write_table,
)


def run(
    name: str | None,
    names: str | None,
    out: Path | None,
    options: MissionOptions,
    maps: int,
    starts: int,
    seed_base: int,
    workers: int | None,
    json: str | None,
) -> int:
    """Fly the rows ``names`` (None: all) of table ``name``, print them and write the table into ``out``; the exit code.

    Raises:
        MissionError, TableError, WorkerError, FinishedFlightsError: one line says what is wrong.
    """
    if name is None:
        raise MissionError("--rows and --out: are for tables; say which one with --table")
    table = tables.TABLES.get(name)
    if table is None:
        raise MissionError(f"--table {name}: there is none; the tables are {', '.join(tables.TABLES)}")
    if json is not None:
        raise MissionError("--json: a table writes its JSON into --out; leave it out")
    if given := [flag(option) for option in chosen(options)]:
        raise MissionError(f"{' '.join(given)}: the rows of a table say what is flown; leave it out")
    wanted = tables.chosen(table, names)
    seeds = seeds_of(seed_base, maps, starts)
    crew = crew_size(workers)
    out = out or Path("tables")
    path = path_of(out, name)
    old = read_table(path) if path.exists() else None
    jobs = prepare(wanted, seeds, out)
    new: list[RowResult] = []

    def landed(row: RowResult) -> None:
        new.append(row)
        whole = merged(table, old, new)
        write_table(out, whole, markdown(whole))

    gauge = Gauge()
    try:
        with closing(gauge):
            gauge.begin(f"{sum(job.missing for job in jobs)} flights")
            fly(jobs, seeds, starts, crew, gauge, landed)
    except KeyboardInterrupt:
        print(
            f"stopped after {len(new)} of {len(jobs)} rows; what was flown is kept in {out}, "
            "and the same command goes on from there",
            file=sys.stderr,
        )
        return 130
    _print(merged(table, None, new))
    print(f"\n{path} and beside it .csv and .md", file=sys.stderr)
    return 0


def show(folder: Path) -> None:
    """Print all tables in ``folder`` as one page of Markdown.

    Raises:
        TableError: there is none.
    """
    print(page(read_tables(folder)), end="")


def _print(result: TableResult) -> None:
    out = console()
    if out.is_terminal:
        out.print(drawn(result))
    else:
        print(markdown(result), end="")
