"""``rsc-swarm sweep``: how a mission degrades, over the values of some of its fields."""

import sys
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from protocols.errors import ExitCode
from rsc_swarm.cli.app import WhoOptions, announce_compiling, app, examples, with_options
from rsc_swarm.machine.leaving import unwind_when_asked
from rsc_swarm.options import MissionOptions, named

if TYPE_CHECKING:
    from rsc_swarm.study.evaluate import Amount
    from rsc_swarm.study.sweep import Axis, Point


@app.command(
    epilog=examples(
        "sweep --mission dense --over radio.burst.loss=0:0.9:0.1",
        "sweep --agents 9 --over radio.burst.loss=0:0.9:0.3 --over radio.frame_rate_hz=5,10,25,100",
        "sweep --mission scrambled --over swap.rule=off,tree,contact --on tcp://host:8786",
    )
)
@with_options
def sweep(
    options: MissionOptions,
    who: WhoOptions,
    over: Annotated[
        list[str],
        typer.Option(
            metavar="FIELD=VALUES", help="FIRST:LAST:STEP or VALUE,VALUE,...; may be repeated: a grid."
        ),
    ],
    name: Annotated[str | None, typer.Argument(metavar="MISSION", help="The same as --mission.")] = None,
    maps: Annotated[int, typer.Option(help="Maps per point.")] = 50,
    starts: Annotated[int, typer.Option(help="Starts per map.")] = 1,
    seed_base: Annotated[int, typer.Option(help="Seed of the first map.")] = 1_000_000,
    out: Annotated[
        Path,
        typer.Option(metavar="DIR", help="Where the table and the picture go; goes on with what is there."),
    ] = Path("sweep"),
) -> None:
    """Evaluate a mission over a grid of values: a table, sweep.csv, sweep.json and (with matplotlib) sweep.svg."""
    from rsc_swarm.study.sweep import parse_axis

    axes = [parse_axis(text) for text in over]
    checked = who.checked()
    announce_compiling()
    from rsc_swarm.study.evaluate import Amount

    raise typer.Exit(_fly(named(options, name), axes, Amount(maps, starts, seed_base, checked), out))


def _fly(options: MissionOptions, axes: "list[Axis]", amount: "Amount", out: Path) -> ExitCode:
    from protocols.mission.document import MissionError
    from rsc_swarm.show.plots.style import PlotError
    from rsc_swarm.show.plots.sweep import draw
    from rsc_swarm.show.progress import Meter
    from rsc_swarm.study.machines import crew_of
    from rsc_swarm.study.sweep import fly, prepare, rows, write

    if options.map is not None or options.seed is not None:
        raise MissionError(
            "--map and --seed: a sweep chooses the seeds; use --seed-base, --maps and --starts"
        )
    jobs, seeds = prepare(options, axes), amount.seeds()
    points: list[Point] = []

    def landed(point: "Point") -> None:
        points.append(point)
        write(out, points)

    meter = Meter()
    try:
        with unwind_when_asked(), closing(meter), crew_of(amount.who) as crew:
            meter.begin(f"{len(jobs)} points")
            fly(jobs, seeds, amount.starts, crew, out, meter, landed)
    except KeyboardInterrupt:
        kept = f"what was flown is kept in {out}, and the same command goes on from there"
        print(f"stopped after {len(points)} of {len(jobs)} points; {kept}", file=sys.stderr)
        return ExitCode.INTERRUPTED
    table = rows(points)
    print("| " + " | ".join(table[0]) + " |\n" + "| --- " * len(table[0]) + "|")
    for row in table:
        print(
            "| "
            + " | ".join(f"{value:.3g}" if isinstance(value, float) else str(value) for value in row.values())
            + " |"
        )
    try:
        draw([axis.field for axis in axes], table, out / "sweep.svg")
        beside = ".json and .svg"
    except PlotError as error:
        beside = f".json; no picture: {error}"
    print(f"\n{out / 'sweep.csv'}, and beside it {beside}", file=sys.stderr)
    return ExitCode.SUCCEEDED
