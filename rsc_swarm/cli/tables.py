"""``rsc-swarm tables``: the paper's tables as one page. And flying one, for ``rsc-swarm evaluate --table``."""

import sys
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from protocols.errors import ExitCode
from rsc_swarm.cli.app import WhoOptions, announce_compiling, app, examples, with_options
from rsc_swarm.machine.leaving import unwind_when_asked
from rsc_swarm.options import MissionOptions, chosen, flag

if TYPE_CHECKING:
    from rsc_swarm.study.evaluate import Amount
    from rsc_swarm.study.machines import Who
    from rsc_swarm.study.tables.result import TableResult


@app.command(
    epilog=examples(
        "tables", "tables docs/results > docs/results.md", "tables docs/results --verify --rows rsc-h20/ours"
    )
)
@with_options
def tables(
    who: WhoOptions,
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where evaluate --table put them.")] = Path(
        "tables"
    ),
    verify: Annotated[
        bool, typer.Option("--verify", help="Instead, fly some flights of each row again and compare.")
    ] = False,
    flights: Annotated[int, typer.Option(min=1, help="With --verify: flights of each row.")] = 6,
    rows: Annotated[
        str | None, typer.Option(metavar="NAME,...", help="With --verify: only these rows, as in evaluate.")
    ] = None,
) -> None:
    """Print the tables flown so far as one page of Markdown, or see whether they still are what comes out."""
    from protocols.mission.document import MissionError
    from rsc_swarm.study.tables.markdown import page
    from rsc_swarm.study.tables.result import read_tables

    found = read_tables(folder)
    if verify:
        raise typer.Exit(verify_tables(found, rows, flights, who.checked()))
    if rows is not None:
        raise MissionError("--rows: says what --verify flies; leave it out")
    print(page(found), end="")


def verify_tables(found: "list[TableResult]", names: str | None, count: int, who: "Who") -> ExitCode:
    """Fly ``count`` flights of each row again, and say of each what came out; FAILED if anything else did.

    Raises:
        protocols.errors.SwarmError: one line says what is wrong.
    """
    from rsc_swarm.study.machines import crew_of
    from rsc_swarm.study.tables.table import chosen
    from rsc_swarm.study.tables.verify import standing, verify

    wanted = chosen(standing(found), names, "these tables")
    announce_compiling()
    wrong = 0
    with unwind_when_asked(), crew_of(who) as crew:
        for stands in wanted:
            verified = verify(stands, count, crew)
            wrong += bool(verified.differences)
            print(f"table {stands.table}, {stands.key}: ", end="")
            print("; ".join(verified.differences) or f"{verified.flown} flights as they stand", flush=True)
    print(f"{len(wanted) - wrong} of {len(wanted)} rows as they stand")
    return ExitCode.FAILED if wrong else ExitCode.SUCCEEDED


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
    from rsc_swarm.study.tables.table import chosen as chosen_rows

    if name is None:
        raise MissionError("--rows and --out: are for tables; say which one with --table")
    table = rows.TABLES.get(name)
    if table is None:
        raise MissionError(f"--table {name}: there is none; the tables are {', '.join(rows.TABLES)}")
    if json is not None:
        raise MissionError("--json: a table writes its JSON into --out; leave it out")
    if given := [flag(option) for option in chosen(options)]:
        raise MissionError(f"{' '.join(given)}: the rows of a table say what is flown; leave it out")
    wanted = chosen_rows(table.rows, names, f"table {name}")
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
