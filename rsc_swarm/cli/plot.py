"""``rsc-swarm plot``: a picture of a flight, a table or a training."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from rsc_swarm.cli.app import announce_compiling, app, examples, with_options
from rsc_swarm.options import MissionOptions


@dataclass(frozen=True)
class FilmOptions:
    """Films that are to be made of a flight."""

    gif: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Make a film of the flight, at twice its speed.")
    ] = None
    mp4: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Make a film of the flight, at its speed; needs ffmpeg."),
    ] = None


@dataclass(frozen=True)
class TableOptions:
    """Tables that a picture is to be made of."""

    horizons: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Draw success against horizon, from the JSON of evaluate --table 1."
        ),
    ] = None
    letter: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Draw the way from the paper to ours, from the JSON of evaluate --table letter.",
        ),
    ] = None


@app.command(
    epilog=examples(
        "plot --map 8 --out flight.png",
        "plot flights/1 --out flight.svg",
        "plot flights/1 --gif flight.gif",
        "plot --compare 25,36 --map 8",
        "plot --horizons tables/table-1.json",
        "plot --letter tables/table-letter.json",
    )
)
@with_options
def plot(
    options: MissionOptions,
    films: FilmOptions,
    tables: TableOptions,
    run: Annotated[
        Path | None,
        typer.Argument(
            metavar="RUN",
            help="A flight that --run-dir has kept; none: fly the mission.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Picture to write: .png, .svg, .pdf. (flight.png)"),
    ] = None,
    run_dir: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="The same as RUN."),
    ] = None,
    compare: Annotated[
        str | None,
        typer.Option(
            metavar="N,N",
            help="Fly the mission with each of these numbers of drones, one picture below the other.",
        ),
    ] = None,
    curve: Annotated[
        list[Path] | None,
        typer.Option(metavar="DIR", help="Draw the learning curves of a training; may be repeated."),
    ] = None,
) -> None:
    """Draw a flight: every drone's path, the obstacles, the formation reached, or its film. Or a table, or a training."""
    announce_compiling()
    from rsc_swarm.cli.pictures import Subject, make, several_asked
    from rsc_swarm.show.plots.film import Film

    wanted: dict[Film, Path | None] = {"gif": films.gif, "mp4": films.mp4}
    asked = {kind: file for kind, file in wanted.items() if file}
    if run and run_dir:
        raise several_asked(str(run), f"--run-dir {run_dir}")
    subject = Subject(run or run_dir, compare, tables.horizons, tables.letter, tuple(curve or ()))
    make(options, out, subject, asked)
