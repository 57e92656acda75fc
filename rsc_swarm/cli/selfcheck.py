"""``rsc-swarm selfcheck``: whether this machine and this installation keep what they promise, one command a check."""

import sys
from collections.abc import Iterator
from typing import Annotated

import typer

from protocols.errors import ExitCode
from rsc_swarm.cli.app import announce_compiling, app
from rsc_swarm.machine.leaving import unwind_when_asked

selfcheck = typer.Typer(help="Try what no drone, network or machine may bring about.")
app.add_typer(selfcheck, name="selfcheck")


@selfcheck.callback(invoke_without_command=True)
def insiders(context: typer.Context) -> None:
    """Try what no drone, network or machine may bring about."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


Runs = Annotated[int, typer.Option(min=1, help="How many.")]
Seed = Annotated[int, typer.Option(help="Of the first; each has one of its own, and repeats with it.")]


@selfcheck.command()
@unwind_when_asked()
def machine(runs: Runs = 100, seed: Seed = 0) -> None:
    """Small launches, each struck by a fault of the machine at a random moment: killed, stopped, asked to leave, a full disk."""
    announce_compiling()
    from rsc_swarm.selfcheck.machine import check

    raise typer.Exit(_report("machine", runs, check(runs, seed, _say)))


@selfcheck.command()
@unwind_when_asked()
def interrupts(runs: Runs = 100, seed: Seed = 0) -> None:
    """One Ctrl-C at a random moment of a small flight, beside two busy loops: is what was flown told and kept?"""
    announce_compiling()
    from rsc_swarm.selfcheck.interrupts import check

    raise typer.Exit(_report("interrupts", runs, check(runs, seed, _say)))


@selfcheck.command()
@unwind_when_asked()
def soak(minutes: Annotated[float, typer.Option(min=0.1, help="How long.")] = 30.0) -> None:
    """Launches in a row: does the memory of launcher, world or drones grow, or the number of files they have open?"""
    announce_compiling()
    from rsc_swarm.selfcheck.soak import soak

    launches, growths = soak(minutes, _say)
    print("\n".join(map(str, growths)))
    growing = [growth.name for growth in growths if growth.grows]
    print(f"{launches} launches: " + (f"these grow: {', '.join(growing)}" if growing else "nothing grows"))
    raise typer.Exit(ExitCode.FAILED if growing else ExitCode.SUCCEEDED)


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _report(name: str, runs: int, found: Iterator[tuple[int, str]]) -> ExitCode:
    """Print what is not as it should be, each with the command that repeats it."""
    faults = 0
    for seed, what in found:
        faults += 1
        print(f"{what}\n    rsc-swarm selfcheck {name} --runs 1 --seed {seed}", flush=True)
    print(f"{runs} runs, {runs - faults} as they should be, {faults} not")
    return ExitCode.FAILED if faults else ExitCode.SUCCEEDED
