"""``rsc-swarm``: the command line. Thin on purpose: each command imports what it needs when it runs."""

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple, NoReturn

import typer

from rsc_swarm.options import Clock, MissionOptions, command_line, resolve, with_options

if TYPE_CHECKING:
    from collections.abc import Callable

    from protocols.mission import Mission
    from rsc_swarm.rundir import RunDir
    from rsc_swarm.view import View
    from world.server import Flown

SUCCEEDED, FAILED, BAD_USAGE, BROKEN, INTERRUPTED = 0, 1, 2, 3, 130

app = typer.Typer(
    name="rsc-swarm",
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help="Fly a swarm of drones in rigid formation, every drone a process of its own.",
    epilog=(
        "Exit codes: 0 the flight succeeded, 1 it failed, 2 bad usage or mission, 3 the run itself broke, 130 Ctrl-C. "
        "Start with [bold]rsc-swarm simulate[/] or [bold]rsc-swarm launch[/]."
    ),
)

JsonFile = Annotated[
    str | None, typer.Option("--json", metavar="FILE", help="Write the report as JSON; - for stdout, and nothing else there.")
]
RunDirectory = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Keep mission, report, every drone's path and the logs here.")
]
ClockOption = Annotated[Clock, typer.Option(help="As fast as possible and repeatable, or 100 Hz on the wall clock.")]


@app.callback()
def _swarm(
    version: Annotated[bool, typer.Option("--version", help="Print the version.", is_eager=True)] = False,
) -> None:
    if version:
        from importlib.metadata import version as version_of

        typer.echo(f"rsc-swarm {version_of('rsc-swarm')}")
        raise typer.Exit(SUCCEEDED)


@app.command(
    epilog="[bold]Examples[/]\n\nrsc-swarm simulate --agents 36 --map 8\n\n"
    "rsc-swarm simulate --mission poor-radio-50 --json - | jq .tau_s\n\n"
    "rsc-swarm simulate --swap off --set start.scrambled=true --run-dir flights/1"
)
@with_options
def simulate(
    options: MissionOptions, clock: ClockOption = Clock.lockstep, json: JsonFile = None, run_dir: RunDirectory = None
) -> None:
    """Fly once, the whole swarm in this one process: fastest, and bit for bit the flight of [bold]launch[/]."""
    mission = resolve(options)
    _announce_compiling()
    from rsc_swarm import flight

    def fly(view: "View", folder: "RunDir | None") -> Told:
        trajectory = folder.trajectory if folder else None
        return Told(flight.fly(mission, clock == Clock.realtime, view.update, trajectory))

    _fly_once("simulate", fly, mission, options, clock, json, run_dir)


@app.command(
    epilog="[bold]Examples[/]\n\nrsc-swarm launch\n\nrsc-swarm launch --agents 100 --clock realtime\n\n"
    "rsc-swarm launch --mission lost-agent --run-dir flights/2"
)
@with_options
def launch(
    options: MissionOptions, clock: ClockOption = Clock.lockstep, json: JsonFile = None, run_dir: RunDirectory = None
) -> None:
    """Fly once, for real: the world and every drone as processes of their own that talk over Zenoh."""
    mission = resolve(options)
    _announce_compiling()
    from rsc_swarm import launch as launcher

    def fly(view: "View", folder: "RunDir | None") -> Told:
        launched = launcher.launch(mission, clock.value, folder.path if folder else None, view.update, weigh=True)
        return Told(launched.flown, launched.first_tick_s, launched.pss_mb)

    _fly_once("launch", fly, mission, options, clock, json, run_dir)


class Told(NamedTuple):
    """What a flight tells: its figures, and those only a launcher knows."""

    flown: "Flown"
    first_tick_s: float | None = None
    pss_mb: float | None = None


def _fly_once(
    mode: Literal["launch", "simulate"],
    fly: "Callable[[View, RunDir | None], Told]",
    mission: "Mission",
    options: MissionOptions,
    clock: Clock,
    json: str | None,
    run_dir: Path | None,
) -> NoReturn:
    """Fly with a live view, print and keep the report, and leave with its exit code."""
    from rsc_swarm.render import console, plain, render
    from rsc_swarm.report import report_of
    from rsc_swarm.rundir import RunDir
    from rsc_swarm.view import View, line

    folder = RunDir(run_dir) if run_dir else None
    if folder:
        folder.begin(mission)
    shape = f"{mission.agents} agents, {mission.name}, policy {mission.policy}, map {mission.map_seed}, seed {mission.seed}"
    try:
        with View(f"rsc-swarm {mode}: {shape}") as view:
            told = fly(view, folder)
    except KeyboardInterrupt:
        reached = f" at {line(view.last)}" if view.last else " before the first tick"
        typer.echo(f"stopped{reached}", err=True)
        raise typer.Exit(INTERRUPTED) from None
    extra = {} if clock == Clock.lockstep else {"clock": clock.value}
    again = command_line(mode, options, **extra)
    report = report_of(told.flown, mission, mode, clock.value, again, told.first_tick_s, told.pss_mb)
    if folder:
        folder.finish(report, plain(render(report)))
    if json:
        _write_json(json, report.model_dump_json(indent=2))
    console(sys.stderr if json == "-" else sys.stdout).print(render(report))
    if report.failure == "interrupted":
        raise typer.Exit(INTERRUPTED)
    raise typer.Exit(SUCCEEDED if report.success else FAILED)


@app.command(
    epilog="[bold]Examples[/]\n\nrsc-swarm evaluate\n\nrsc-swarm evaluate --maps 20 --starts 1\n\n"
    "rsc-swarm evaluate --mission dense --swap tree --json dense-tree.json"
)
@with_options
def evaluate(
    options: MissionOptions,
    maps: Annotated[int, typer.Option(help="Number of maps.")] = 200,
    starts: Annotated[int, typer.Option(help="Starts per map.")] = 3,
    seed_base: Annotated[
        int,
        typer.Option(help="Seed of the first map. 0 to 199 are the test set; train and tune on 1000000 and above."),
    ] = 0,
    workers: Annotated[int | None, typer.Option(help="Processes to fly with. (one per processor)")] = None,
    json: Annotated[
        str | None,
        typer.Option(
            "--json", metavar="FILE", help="Write the results as JSON, and keep finished flights beside it to go on after a stop."
        ),
    ] = None,
) -> None:
    """Fly many maps and starts, and print one row of a table. Start k of map m has seed 1000 m + k."""
    mission = resolve(options)
    _announce_compiling()
    from rsc_swarm import evaluation_run

    code = evaluation_run.run(mission, options, maps, starts, seed_base, workers, json)
    raise typer.Exit(code)


@app.command(
    epilog="[bold]Examples[/]\n\nrsc-swarm plot --map 8 --out flight.png\n\nrsc-swarm plot --run-dir flights/1 --out flight.svg"
)
@with_options
def plot(
    options: MissionOptions,
    out: Annotated[Path, typer.Option(metavar="FILE", help="Picture to write: .png, .svg or .pdf.")] = Path("flight.png"),
    run_dir: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Draw the flight recorded here instead of flying the mission.")
    ] = None,
) -> None:
    """Draw a flight: every drone's path, the obstacles, the formation reached."""
    from rsc_swarm import plot_command

    raise typer.Exit(plot_command.run(options, out, run_dir))


@app.command(
    epilog="[bold]Examples[/]\n\nrsc-swarm mission --mission dense --agents 36 > my.yaml\n\n"
    "rsc-swarm mission --mission my.yaml --check\n\nrsc-swarm mission --list"
)
@with_options
def mission(
    options: MissionOptions,
    check: Annotated[bool, typer.Option("--check", help="Only say whether it can be flown.")] = False,
    list_: Annotated[bool, typer.Option("--list", help="List the missions that come with rsc-swarm.")] = False,
) -> None:
    """Print the mission these options make, every field, as YAML; refuse one that cannot be flown."""
    from rsc_swarm import mission_command

    mission_command.run(options, check, list_)


@app.command(epilog="[bold]Example[/]\n\nrsc-swarm world --listen tcp/0.0.0.0:7447 --credentials-dir keys --agents 4")
@with_options
def world(
    options: MissionOptions,
    listen: Annotated[list[str], typer.Option(metavar="ENDPOINT", help="Where drones reach the world; may be repeated.")],
    credentials_dir: Annotated[
        Path, typer.Option(metavar="DIR", help="Where to put one credentials file per drone; copy each to its machine.")
    ],
    clock: ClockOption = Clock.lockstep,
    json: JsonFile = None,
    run_dir: RunDirectory = None,
) -> None:
    """Run the world alone, for drones on other machines."""
    mission = resolve(options)
    _announce_compiling()
    from rsc_swarm import launch as launcher

    from world.recorder import Recorder

    def fly(view: "View", folder: "RunDir | None") -> Told:
        recorder = Recorder(mission)
        view.say(f"waiting for {mission.agents} agents at {', '.join(listen)}; their credentials are in {credentials_dir}")
        flown = launcher.serve_world(mission, clock.value, listen, credentials_dir, view.update, recorder.record)
        if folder:
            recorder.save(folder.trajectory)
        return Told(flown)

    _fly_once("launch", fly, mission, options, clock, json, run_dir)


@app.command(
    epilog="[bold]Example[/]\n\nrsc-swarm agent --agent 0 --connect tcp/192.168.1.10:7447 --credentials agent-0.json"
)
def agent(
    agent: Annotated[int, typer.Option(metavar="I", min=0, help="Which drone this is.")],
    connect: Annotated[str, typer.Option(metavar="ENDPOINT", help="Where the world listens.")],
    credentials: Annotated[Path, typer.Option(metavar="FILE", help="This drone's credentials, made by the world.")],
) -> None:
    """Run one drone alone; it gets its mission from the world."""
    _announce_compiling()
    from rsc_swarm import launch as launcher

    def say(seconds: float) -> None:
        typer.echo(f"agent {agent} ready after {seconds:.2f} s", err=True)

    reason = launcher.fly_agent(agent, connect, credentials, say)
    typer.echo(f"agent {agent}: {reason}", err=True)
    raise typer.Exit(BROKEN if "silent" in reason else SUCCEEDED)


@app.command()
def bench(
    agents: Annotated[int, typer.Option("--agents", "-n", help="Number of drones.")] = 25,
    quick: Annotated[bool, typer.Option("--quick", help="Shorter runs, rougher figures.")] = False,
    json: JsonFile = None,
) -> None:
    """Measure this machine: ticks per second, start-up, memory."""
    _announce_compiling()
    from rsc_swarm import bench as benches

    benches.bench(agents, quick, json)


@app.command()
def schema(
    markdown: Annotated[bool, typer.Option("--markdown", help="As a table of fields, for people.")] = False,
) -> None:
    """Print what the fields of a report mean, as JSON Schema."""
    from rsc_swarm import report_schema

    typer.echo(report_schema.markdown() if markdown else report_schema.json_schema(), nl=False)


def _write_json(target: str, text: str) -> None:
    if target == "-":
        typer.echo(text)
        return
    from rsc_swarm.rundir import write_whole

    try:
        write_whole(Path(target), text + "\n")
    except OSError as error:
        raise typer.BadParameter(f"{target} cannot be written ({error.strerror})", param_hint="--json") from None


def _announce_compiling() -> None:
    from protocols.kernels import CACHE_DIR

    if not any(CACHE_DIR.iterdir()):
        typer.echo("compiling flight kernels, once (about 20 s)...", err=True)


def main() -> None:
    """The ``rsc-swarm`` command: whatever goes wrong is one line on stderr and an exit code."""
    arguments = sys.argv[1:] or ["--help"]
    try:
        code = app(arguments, prog_name="rsc-swarm", standalone_mode=False)
    except KeyboardInterrupt:
        code = INTERRUPTED
    except Exception as error:
        if os.environ.get("RSC_SWARM_TRACEBACK"):
            raise
        code, text = _explained(error)
        print(f"rsc-swarm: {text}", file=sys.stderr)
    sys.exit(code if isinstance(code, int) else SUCCEEDED)


_USERS = ("MissionError", "PolicyError", "FieldError", "RunDirError", "PlotError", "JournalError")  # by name: nothing to import
_RUNS = ("RunBroken", "CrewError")


def _explained(error: Exception) -> tuple[int, str]:
    """Exit code and one line for an error."""
    kind = type(error).__name__
    if hasattr(error, "format_message"):  # the option parser's
        text = " ".join(error.format_message().split())
        return BAD_USAGE, f"{text[:1].lower()}{text[1:]}"
    text = " ".join(str(error).split())
    if kind in _USERS:
        return BAD_USAGE, text
    if kind in _RUNS:
        return BROKEN, text
    return BROKEN, f"unexpected {kind}: {text[:160]} (set RSC_SWARM_TRACEBACK=1 to see where)"


if __name__ == "__main__":
    main()
