"""What all commands share: the application, options that several of them take, and the look of their help."""

import inspect
import sys
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from enum import StrEnum
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from protocols.errors import ExitCode

if TYPE_CHECKING:
    from rsc_swarm.study.machines import Who

app = typer.Typer(
    name="rsc-swarm",
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Fly a swarm of drones in rigid formation, every drone a process of its own.",
    epilog=f"Exit codes: {ExitCode.SUCCEEDED:d} the flight succeeded, {ExitCode.FAILED:d} it failed, "
    f"{ExitCode.BAD_USAGE:d} bad usage or mission, {ExitCode.BROKEN:d} the run itself broke, "
    f"{ExitCode.INTERRUPTED:d} stopped by Ctrl-C or SIGTERM. "
    "Begin with [bold]rsc-swarm simulate[/] or [bold]rsc-swarm launch[/].",
)

JsonFile = Annotated[
    str | None,
    typer.Option(
        "--json", metavar="FILE", help="Write the report as JSON; - for stdout, and nothing else there."
    ),
]
PlainText = Annotated[
    bool,
    typer.Option(
        "--plain-text", help="Let tcp/ leave this machine, where everybody on the way can read and change it."
    ),
]


def endpoints(given: Any) -> Any:
    """Of an option: an endpoint, several, or none. Raises typer.BadParameter if one is none."""
    from protocols.wire.endpoints import checked_endpoint
    from protocols.wire.keys import LinkError

    try:
        for endpoint in given if isinstance(given, list | tuple) else [given] if given is not None else []:
            checked_endpoint(endpoint)
    except LinkError as error:
        raise typer.BadParameter(str(error)) from None
    return given


class Clock(StrEnum):
    """How fast the ticks come."""

    lockstep = "lockstep"
    realtime = "realtime"


WATCHING = "Watching in a browser"
OpenBrowser = Annotated[
    bool,
    typer.Option("--open", help="Serve the page, and open it in a browser.", rich_help_panel=WATCHING),
]
ViewPort = Annotated[
    int | None,
    typer.Option(
        metavar="PORT", min=0, max=65535, help="Its port; 0: any. (8750, or any if that is taken)",
        rich_help_panel=WATCHING,
    ),
]  # fmt: skip
ViewHost = Annotated[
    str,
    typer.Option(metavar="ADDRESS", help="Its address; 0.0.0.0: for everybody.", rich_help_panel=WATCHING),
]


@dataclass(frozen=True)
class ViewOptions:
    """Options of every command whose flight can be watched in a browser."""

    view: Annotated[
        bool,
        typer.Option(
            "--view", help="Serve a live page of the flight; prints its address.", rich_help_panel=WATCHING
        ),
    ] = False
    open: OpenBrowser = False
    view_port: ViewPort = None
    view_host: ViewHost = "127.0.0.1"


@dataclass(frozen=True)
class FlightOptions(ViewOptions):
    """Options of every command that flies once: how fast, and where the flight is kept."""

    clock: Annotated[
        Clock, typer.Option(help="As fast as the machine can and repeatable, or 100 Hz on the wall clock.")
    ] = Clock.lockstep
    json: JsonFile = None
    run_dir: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Keep mission, policy, report, all paths and the logs here."),
    ] = None
    mcap: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the flight for Foxglove, Rerun and PlotJuggler."),
    ] = None
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Use a --run-dir again that holds an earlier flight.")
    ] = False


DaskWorkers = Annotated[
    str | None,
    typer.Option(
        metavar="local:N|ADDRESS",
        help="Fly on Dask workers instead: so many on this machine, or those of a scheduler, tcp://host:8786.",
    ),
]


@dataclass(frozen=True)
class WhoOptions:
    """Options of every command that flies many times: who flies."""

    workers: Annotated[int | None, typer.Option(help="Processes to fly with. (one per processor)")] = None
    on: DaskWorkers = None

    def checked(self) -> "Who":
        """What is asked for.

        Raises:
            protocols.mission.document.MissionError: it names nobody.
        """
        from rsc_swarm.study.machines import Who, check_who

        who = Who(self.workers, self.on)
        check_who(who)
        return who


def examples(*lines: str) -> str:
    """The end of a command's help."""
    return "[bold]Examples[/]\n\n" + "\n\n".join(f"[cyan]rsc-swarm {line}[/]" for line in lines)


def refuse_besides(context: typer.Context, option: str, *means: str) -> None:
    """Refuse what was given besides ``option`` and says nothing there; ``means``: the parameters that do.

    Raises:
        typer.BadParameter: something was.
    """
    given = [
        parameter.opts[0] if parameter.param_type_name == "option" else str(context.params[parameter.name])
        for parameter in context.command.params
        if parameter.name and parameter.name not in means and parameter.opts[0] != option
        if getattr(context.get_parameter_source(parameter.name), "name", "") == "COMMANDLINE"
    ]
    if given:
        raise typer.BadParameter(f"{option}: {' '.join(given)} says nothing beside it; leave it out")


def announce_compiling() -> None:
    """Compile the rules if that has not been done, and show how far it has come.

    On a terminal one sees something at once, whatever is loaded first; what comes next is written over it.

    Raises:
        rsc_swarm.machine.limits.MachineError: too little memory or too few threads are allowed even to import what it needs.
    """
    if sys.stderr.isatty():
        print("getting ready...", end="\r", file=sys.stderr, flush=True)
    from rsc_swarm.machine.limits import check_addresses, check_threads

    check_addresses()
    check_threads()
    from agent.policy.learned_kernel import fly_quickly  # of all rules it is compiled last
    from protocols.kernels import is_kept

    if not is_kept(fly_quickly):
        from rsc_swarm.cli.compiling import compile_flight

        compile_flight()


def print_version(wanted: bool) -> None:
    """The ``--version`` option."""
    if wanted:
        from importlib.metadata import version

        typer.echo(f"rsc-swarm {version('rsc-swarm')}")
        raise typer.Exit(ExitCode.SUCCEEDED)


@app.callback()
def _swarm(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", is_eager=True, callback=print_version)
    ] = False,
) -> None:
    pass


def with_options(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command one option per field of each parameter that is a dataclass of options."""
    parameters = inspect.signature(command).parameters
    groups: dict[str, Any] = {
        name: entry.annotation for name, entry in parameters.items() if is_dataclass(entry.annotation)
    }
    flat = [
        entry.replace(kind=inspect.Parameter.KEYWORD_ONLY)
        for name, entry in parameters.items()
        if name not in groups
    ]
    for group in groups.values():
        flat += [
            inspect.Parameter(
                field.name, inspect.Parameter.KEYWORD_ONLY, default=field.default, annotation=field.type
            )
            for field in fields(group)
        ]

    @wraps(command)
    def run(**values: Any) -> None:
        for name, group in groups.items():
            values[name] = group(**{field.name: values.pop(field.name) for field in fields(group)})
        command(**values)

    run.__signature__ = inspect.Signature(flat)  # type: ignore[attr-defined]
    run.__annotations__ = {entry.name: entry.annotation for entry in flat}
    return run
