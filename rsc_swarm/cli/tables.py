"""``rsc-swarm tables``: the paper's tables as one page. And flying one, for ``rsc-swarm evaluate --table``."""

import sys
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from protocols.errors import ExitCode
from rsc_swarm.cli.app import app, examples
from rsc_swarm.machine.leaving import unwind_when_asked
from rsc_swarm.options import MissionOptions, chosen, flag

if TYPE_CHECKING:
    from rsc_swarm.study.evaluate import Amount


@app.command(epilog=examples("tables", "tables docs/results > docs/results.md"))
def tables(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where evaluate --table put them.")] = Path(
        "tables"
    ),
) -> None:
    """Print the tables flown so far as one page of Markdown."""
    from rsc_swarm.study.tables.markdown import page
    from rsc_swarm.study.tables.result import read_tables

    print(page(read_tables(folder)), end="")


def fly_table(
    name: str | None,
    names: str | None,
    out: Path | None,
    options: MissionOptions,
    amount: "Amount",
    json: str | None,
) -> ExitCode:
    """Fly the rows ``names`` (None: all) of table ``name``, print them and write the table into ``out``.

    Raises:
        protocols.errors.SwarmError: one line says what is wrong.
    """
    from protocols.mission.document import MissionError
    from rsc_swarm.show.progress import Meter
    from rsc_swarm.show.render import console
    from rsc_swarm.study.machines import crew_of
    from rsc_swarm.study.tables import rows
    from rsc_swarm.study.tables.flying import fly, prepare
    from rsc_swarm.study.tables.markdown import drawn, markdown
    from rsc_swarm.study.tables.result import RowResult, merged, path_of, read_table, write_table

    if name is None:
        raise MissionError("--rows and --out: are for tables; say which one with --table")
    table = rows.TABLES.get(name)
    if table is None:
        raise MissionError(f"--table {name}: there is none; the tables are {', '.join(rows.TABLES)}")
    if json is not None:
        raise MissionError("--json: a table writes its JSON into --out; leave it out")
    if given := [flag(option) for option in chosen(options)]:
        raise MissionError(f"{' '.join(given)}: the rows of a table say what is flown; leave it out")
    wanted = rows.chosen(table, names)
    seeds = amount.seeds()
    out = out or Path("tables")
    path = path_of(out, name)
    old = read_table(path) if path.exists() else None
    jobs = prepare(wanted, seeds, out)
    new: list[RowResult] = []

    def landed(row: RowResult) -> None:
        new.append(row)
        whole = merged(table, old, new)
        write_table(out, whole, markdown(whole))

    meter = Meter()
    try:
        with unwind_when_asked(), closing(meter), crew_of(amount.who) as crew:
            meter.begin(f"{sum(job.missing for job in jobs)} flights")
            fly(jobs, seeds, amount.starts, crew, meter, landed)
    except KeyboardInterrupt:
        print(
            f"stopped after {len(new)} of {len(jobs)} rows; what was flown is kept in {out}, "
            "and the same command goes on from there",
            file=sys.stderr,
        )
        return ExitCode.INTERRUPTED
    screen, result = console(), merged(table, None, new)
    if screen.is_terminal:
        screen.print(drawn(result))
    else:
        print(markdown(result), end="")
    print(f"\n{path} and beside it .csv and .md", file=sys.stderr)
    return ExitCode.SUCCEEDED
