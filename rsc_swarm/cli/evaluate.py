"""``rsc-swarm evaluate``: many flights, and the row of a table that they add up to; or a whole table."""

import sys
import time
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from protocols.errors import ExitCode
from rsc_swarm.cli.app import WhoOptions, announce_compiling, app, examples, with_options
from rsc_swarm.machine.leaving import unwind_when_asked
from rsc_swarm.options import MissionOptions, command_line, resolve

if TYPE_CHECKING:
    from rsc_swarm.study.evaluate import Amount

_TABLES = "The paper's tables"


@dataclass(frozen=True)
class TableOptions:
    """Options that say which table is flown. None: no table."""

    table: Annotated[
        str | None,
        typer.Option(
            metavar="1|2|3|harder|letter|slots",
            help="Fly a whole table instead, beside the paper's figures.",
            rich_help_panel=_TABLES,
        ),
    ] = None
    rows: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help="Only these rows of it, e.g. [bold]rsc-h20,expert[/] or [bold]n36/ours[/].",
            rich_help_panel=_TABLES,
        ),
    ] = None
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Where tables go, as JSON, CSV and Markdown; a second call flies what is missing. (tables)",
            rich_help_panel=_TABLES,
        ),
    ] = None


@app.command(
    epilog=examples(
        "evaluate",
        "evaluate --maps 20 --starts 1",
        "evaluate --mission dense --swap tree --json dense-tree.json",
        "evaluate --table 1 --maps 20",
    )
)
@with_options
def evaluate(
    options: MissionOptions,
    tables: TableOptions,
    who: WhoOptions,
    maps: Annotated[int, typer.Option(help="Number of maps.")] = 200,
    starts: Annotated[int, typer.Option(help="Starts per map.")] = 3,
    seed_base: Annotated[
        int,
        typer.Option(
            help="Seed of the first map. 0 to 199 are the test set; train and tune on 1000000 and up."
        ),
    ] = 0,
    json: Annotated[
        str | None,
        typer.Option(
            "--json",
            metavar="FILE",
            help="Write the results as JSON. Finished flights are kept beside it, to go on after a stop.",
        ),
    ] = None,
) -> None:
    """Fly many maps and starts and print one row of a table, or a whole table. Start k of map m has seed 1000 m + k."""
    announce_compiling()
    from rsc_swarm.study.evaluate import Amount

    amount = Amount(maps, starts, seed_base, who.checked())
    if tables == TableOptions():
        raise typer.Exit(fly_row(options, amount, json))
    from rsc_swarm.cli.tables import fly_table

    raise typer.Exit(fly_table(tables.table, tables.rows, tables.out, options, amount, json))


def fly_row(options: MissionOptions, amount: "Amount", json: str | None) -> ExitCode:
    """Fly, print and write one row; how the command ends.

    Raises:
        protocols.errors.SwarmError: as rsc_swarm.study.evaluate.evaluate.
    """
    from protocols.mission.document import MissionError
    from rsc_swarm.cli.output import JsonOutput
    from rsc_swarm.show.evaluation import print_notes, render
    from rsc_swarm.show.progress import Meter
    from rsc_swarm.show.render import console
    from rsc_swarm.study.evaluate import evaluate, summarise
    from rsc_swarm.study.fingerprint import fingerprint
    from rsc_swarm.study.machines import crew_of
    from rsc_swarm.study.progress import TICKS_GUESS, Flights

    if options.map is not None or options.seed is not None:
        raise MissionError(
            "--map and --seed: evaluate chooses the seeds; use --seed-base, --maps and --starts"
        )
    seeds = amount.seeds()
    mission = resolve(options)
    output = JsonOutput(json)
    code = fingerprint(mission)
    journal = output.journal(code)
    begin = time.monotonic()
    meter = Meter()
    progress = Flights(TICKS_GUESS * mission.ticks, meter)
    try:
        with unwind_when_asked(), closing(meter), crew_of(amount.who) as crew:
            meter.begin(f"{len(seeds)} flights")
            flights = evaluate(mission, seeds, crew, journal, progress)
    except KeyboardInterrupt:
        failed = sum(not flight.outcome.success for flight in progress.flights)
        kept = (
            "; they are kept, and the same command goes on from there" if journal and progress.flights else ""
        )
        print(
            f"stopped after {len(progress.flights)} of {len(seeds)} flights, {failed} failed{kept}",
            file=sys.stderr,
        )
        return ExitCode.INTERRUPTED
    result = summarise(mission, flights, amount.starts, code)
    took_s = time.monotonic() - begin

    def tell() -> None:
        out = console(output.beside)
        out.print(render(result, rich=out.is_terminal))
        print_notes(
            out,
            result,
            took_s,
            lambda failed: command_line("simulate", options, map=failed.map, seed=failed.seed),
        )
        flown = {"maps": amount.maps, "starts": amount.starts, "seed_base": amount.seed_base}
        out.print(f"\nThe row again:  {command_line('evaluate', options, **flown)}", soft_wrap=True)

    output.tell(tell, result.model_dump_json(indent=2))
    return ExitCode.SUCCEEDED
