"""``rsc-swarm``: the command line. Thin on purpose: each command imports what it needs when it runs."""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from rsc_swarm.cli.options import Clock, MissionOptions, with_options

SUCCEEDED, FAILED, BAD_USAGE, BROKEN, INTERRUPTED = 0, 1, 2, 3, 130

# Errors by the name of their class, so that nothing has to be imported to tell them apart.
_BAD_USAGE = (
    "MissionError",
    "PolicyError",
    "FieldError",
    "RunDirError",
    "PlotError",
    "FinishedFlightsError",
    "TrainingError",
    "TableError",
)
_BROKEN = ("RunBroken", "WorkerError")

_TABLES = "The paper's tables"

app = typer.Typer(
    name="rsc-swarm",
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Fly a swarm of drones in rigid formation, every drone a process of its own.",
    epilog="Exit codes: 0 the flight succeeded, 1 it failed, 2 bad usage or mission, 3 the run itself broke, "
    "130 stopped by Ctrl-C. Begin with [bold]rsc-swarm simulate[/] or [bold]rsc-swarm launch[/].",
)


def _examples(*lines: str) -> str:
    return "[bold]Examples[/]\n\n" + "\n\n".join(f"[cyan]rsc-swarm {line}[/]" for line in lines)


JsonFile = Annotated[
    str | None,
    typer.Option(
        "--json", metavar="FILE", help="Write the report as JSON; - for stdout, and nothing else there."
    ),
]
RunFolder = Annotated[
    Path | None,
    typer.Option("--run-dir", metavar="DIR", help="Keep mission, report, all paths and the logs here."),
]
ClockOption = Annotated[
    Clock, typer.Option(help="As fast as the machine can and repeatable, or 100 Hz on the wall clock.")
]


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"rsc-swarm {version('rsc-swarm')}")
        raise typer.Exit(SUCCEEDED)


@app.callback()
def _swarm(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    pass


@app.command(
    epilog=_examples(
        "simulate --agents 36 --map 8",
        "simulate --mission poor-radio-50 --json - | jq .tau_s",
        "simulate --swap off --set start.scrambled=true --run-dir flights/1",
    )
)
@with_options
def simulate(
    options: MissionOptions,
    clock: ClockOption = Clock.lockstep,
    json: JsonFile = None,
    run_dir: RunFolder = None,
) -> None:
    """Fly once, the whole swarm in this one process: fastest, and bit for bit the flight of launch."""
    _announce_compiling()
    from rsc_swarm.cli import fly as fly_command

    raise typer.Exit(fly_command.simulate(options, clock, json, run_dir))


@app.command(
    epilog=_examples(
        "launch", "launch --agents 100 --clock realtime", "launch --mission restart --run-dir flights/2"
    )
)
@with_options
def launch(
    options: MissionOptions,
    clock: ClockOption = Clock.lockstep,
    json: JsonFile = None,
    run_dir: RunFolder = None,
) -> None:
    """Fly once, for real: the world and every drone as processes of their own that talk over Zenoh."""
    _announce_compiling()
    from rsc_swarm.cli import fly as fly_command

    raise typer.Exit(fly_command.launch(options, clock, json, run_dir))


@app.command(
    epilog=_examples(
        "evaluate",
        "evaluate --maps 20 --starts 1",
        "evaluate --mission dense --swap tree --json dense-tree.json",
        "evaluate --table 1 --maps 20",
    )
)
@with_options
def evaluate(
    options: MissionOptions,
    maps: Annotated[int, typer.Option(help="Number of maps.")] = 200,
    starts: Annotated[int, typer.Option(help="Starts per map.")] = 3,
    seed_base: Annotated[
        int,
        typer.Option(
            help="Seed of the first map. 0 to 199 are the test set; train and tune on 1000000 and up."
        ),
    ] = 0,
    workers: Annotated[int | None, typer.Option(help="Processes to fly with. (one per processor)")] = None,
    json: Annotated[
        str | None,
        typer.Option(
            "--json",
            metavar="FILE",
            help="Write the results as JSON. Finished flights are kept beside it, to go on after a stop.",
        ),
    ] = None,
    table: Annotated[
        str | None,
        typer.Option(
            metavar="1|2|3|harder|slots",
            help="Fly a whole table instead, beside the paper's figures.",
            rich_help_panel=_TABLES,
        ),
    ] = None,
    rows: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help="Only these rows of it, e.g. [bold]rsc-h20,expert[/] or [bold]n36/ours[/].",
            rich_help_panel=_TABLES,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Where tables go, as JSON, CSV and Markdown; a second call flies what is missing. (tables)",
            rich_help_panel=_TABLES,
        ),
    ] = None,
) -> None:
    """Fly many maps and starts and print one row of a table, or a whole table. Start k of map m has seed 1000 m + k."""
    _announce_compiling()
    if (table, rows, out) == (None, None, None):
        from rsc_swarm.cli import evaluate as evaluate_command

        raise typer.Exit(evaluate_command.run(options, maps, starts, seed_base, workers, json))
    from rsc_swarm.study.tables import command

    raise typer.Exit(command.run(table, rows, out, options, maps, starts, seed_base, workers, json))


@app.command(epilog=_examples("tables", "tables docs/results > docs/results.md"))
def tables(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where evaluate --table put them.")] = Path(
        "tables"
    ),
) -> None:
    """Print the tables flown so far as one page of Markdown."""
    from rsc_swarm.study.tables import command

    command.show(folder)


@app.command(
    epilog=_examples(
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
    _announce_compiling()
    from rsc_swarm.cli import plot as plot_command

    plot_command.run(options, out, plot_command.Subject(run_dir, compare, horizons, tuple(curve or ())))


@app.command(
    epilog=_examples(
        "train --horizon 20",
        "train --horizon 10 --preset paper --out training/paper-h10",
        "train --config mine.yaml --seed 2 --threads 1",
    )
)
def train(
    horizon: Annotated[int | None, typer.Option(metavar="H", help="Planned steps of 10 ms. (20)")] = None,
    preset: Annotated[
        str,
        typer.Option(
            help="default: what ships; paper: the shape and output of the paper; stgnn: the baseline."
        ),
    ] = "default",
    config: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Fields of the training config (YAML), on top of it.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of weights, maps and batches. (0)")] = None,
    epochs: Annotated[int | None, typer.Option(help="How often to fly and learn. (20)")] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Checkpoints, curves and model.onnx; goes on with what is there. (training/NAME-SEED)",
        ),
    ] = None,
    device: Annotated[
        str, typer.Option(help="auto, cpu or cuda; auto takes a GPU if there is one.")
    ] = "auto",
    threads: Annotated[int | None, typer.Option(min=1, help="Of torch. (one per processor)")] = None,
) -> None:
    """Train a policy by imitation of the expert and write it as a model file. Ctrl-C and the same command: goes on."""
    _announce_compiling()
    from rsc_swarm.cli import train as train_command

    given = {"horizon": horizon, "seed": seed, "epochs": epochs}
    raise typer.Exit(train_command.run(preset, config, out, device, threads, **given))


@app.command(
    epilog=_examples(
        "mission --list", "mission --mission dense --agents 36 > my.yaml", "mission --mission my.yaml --check"
    )
)
@with_options
def mission(
    options: MissionOptions,
    check: Annotated[bool, typer.Option("--check", help="Only say whether it can be flown.")] = False,
    shipped: Annotated[
        bool, typer.Option("--list", help="List the missions that come with rsc-swarm.")
    ] = False,
) -> None:
    """Print the mission these options make, every field, as YAML; refuse one that cannot be flown."""
    from rsc_swarm.cli import mission as mission_command

    mission_command.run(options, check, shipped)


@app.command(epilog=_examples("world --listen tcp/0.0.0.0:7447 --credentials-dir keys --agents 4"))
@with_options
def world(
    options: MissionOptions,
    listen: Annotated[
        list[str], typer.Option(metavar="ENDPOINT", help="Where drones reach it; may be repeated.")
    ],
    credentials_dir: Annotated[
        Path,
        typer.Option(
            metavar="DIR", help="Where to put a credentials file per drone, to copy to its machine."
        ),
    ],
    clock: ClockOption = Clock.lockstep,
    json: JsonFile = None,
    run_dir: RunFolder = None,
    join_s: Annotated[float, typer.Option(min=1, help="How long to wait for all drones to arrive.")] = 120.0,
) -> None:
    """Run the world alone, for drones on other machines."""
    _announce_compiling()
    from rsc_swarm.cli import fly as fly_command

    raise typer.Exit(fly_command.world(options, listen, credentials_dir, clock, json, run_dir, join_s))


@app.command(epilog=_examples("agent --agent 0 --connect tcp/192.168.1.10:7447 --credentials agent-0.json"))
def agent(
    agent: Annotated[int, typer.Option(metavar="I", min=0, help="Which drone this is.")],
    connect: Annotated[str, typer.Option(metavar="ENDPOINT", help="Where the world listens.")],
    credentials: Annotated[
        Path,
        typer.Option(
            metavar="FILE", exists=True, dir_okay=False, help="This drone's, as written by the world."
        ),
    ],
) -> None:
    """Run one drone alone; it gets its mission from the world."""
    _announce_compiling()
    from rsc_swarm.flight import launch as launcher

    def say(seconds: float) -> None:
        typer.echo(f"agent {agent}: ready after {seconds:.2f} s", err=True)

    reason = launcher.fly_agent(agent, connect, credentials, say)
    typer.echo(f"agent {agent}: {reason}", err=True)
    raise typer.Exit(BROKEN if "silent" in reason else SUCCEEDED)


@app.command(epilog=_examples("bench", "bench --agents 100 --quick"))
def bench(
    agents: Annotated[int, typer.Option("--agents", "-n", help="Number of drones.")] = 25,
    quick: Annotated[bool, typer.Option("--quick", help="Shorter runs, rougher figures.")] = False,
    twins: Annotated[
        int, typer.Option(help="Instead: fly so many maps in real processes and in one, and compare digests.")
    ] = 0,
    json: JsonFile = None,
) -> None:
    """Measure this machine: ticks per second, start-up, memory."""
    _announce_compiling()
    from json import dumps

    from rsc_swarm.bench import bench as benches

    if twins:
        flown = benches.twins(agents, twins, lambda line: typer.echo(line, err=True))
        typer.echo(", ".join(f"{number} {name.replace('_', ' ')}" for name, number in flown.items()))
        raise typer.Exit(SUCCEEDED if flown["equal_digests"] == twins else FAILED)
    figures = benches.bench(agents, quick, lambda line: typer.echo(f"measuring {line}...", err=True))
    if json == "-":
        typer.echo(dumps(figures, indent=2))
        return
    typer.echo(benches.render(figures))
    if json:
        Path(json).write_text(dumps(figures, indent=2) + "\n")


@app.command()
def schema(
    markdown: Annotated[bool, typer.Option("--markdown", help="As a table of fields, for people.")] = False,
) -> None:
    """Print what the fields of a report mean, as JSON Schema."""
    from rsc_swarm.show import report_schema

    typer.echo(report_schema.markdown() if markdown else report_schema.json_schema(), nl=False)


def _announce_compiling() -> None:
    from agent.tick import before_policy
    from protocols.kernels import is_kept

    if not is_kept(before_policy):
        typer.echo("compiling flight kernels, once (about a minute)...", err=True)


def main() -> None:
    """The ``rsc-swarm`` command: whatever goes wrong is one line on stderr and an exit code."""
    try:
        code = app(sys.argv[1:] or ["--help"], prog_name="rsc-swarm", standalone_mode=False)
    except KeyboardInterrupt:
        code = INTERRUPTED
    except Exception as error:
        if os.environ.get("RSC_SWARM_TRACEBACK"):
            raise
        code, text = _explain(error)
        print(f"rsc-swarm: {text}", file=sys.stderr)
    sys.exit(code if isinstance(code, int) else SUCCEEDED)


def _explain(error: Exception) -> tuple[int, str]:
    """Exit code and one line for an error."""
    kind = type(error).__name__
    if hasattr(error, "format_message"):  # the option parser's
        text = " ".join(error.format_message().split())
        return BAD_USAGE, f"{text[:1].lower()}{text[1:]}"
    text = " ".join(str(error).split())
    if kind in _BAD_USAGE:
        return BAD_USAGE, text
    if kind in _BROKEN:
        return BROKEN, text
    return BROKEN, f"unexpected {kind}: {text[:160]} (set RSC_SWARM_TRACEBACK=1 to see where)"


if __name__ == "__main__":
    main()
