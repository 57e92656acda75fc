"""``rsc-swarm plot``: a picture of a flight, a table or a training."""

from pathlib import Path
from typing import Annotated

import typer

from rsc_swarm.cli.app import announce_compiling, app, examples, with_options
from rsc_swarm.options import MissionOptions


@app.command(
    epilog=examples(
        "plot --map 8 --out flight.png",
        "plot --run-dir flights/1 --out flight.svg",
        "plot --compare 25,36 --map 8",
        "plot --horizons tables/table-1.json",
    )
)
@with_options
def plot(
    options: MissionOptions,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Picture to write: .png, .svg, .pdf. (flight.png)"),
    ] = None,
    run_dir: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Draw the flight recorded here instead of flying the mission."),
    ] = None,
    compare: Annotated[
        str | None,
        typer.Option(
            metavar="N,N",
            help="Fly the mission with each of these numbers of drones, one picture below the other.",
        ),
    ] = None,
    horizons: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Draw success against horizon, from the JSON of evaluate --table 1."
        ),
    ] = None,
    curve: Annotated[
        list[Path] | None,
        typer.Option(metavar="DIR", help="Draw the learning curves of a training; may be repeated."),
    ] = None,
) -> None:
    """Draw a flight: every drone's path, the obstacles, the formation reached. Or a table, or a training."""
    announce_compiling()
    from rsc_swarm.cli.pictures import Subject, run

    run(options, out, Subject(run_dir, compare, horizons, tuple(curve or ())))
