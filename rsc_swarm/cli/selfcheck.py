"""``rsc-swarm selfcheck``: whether this machine and this installation keep what they promise, one command a check."""

import sys
from collections.abc import Iterator
from contextlib import closing
from typing import Annotated

import typer

from protocols.errors import ExitCode
from rsc_swarm.cli.app import JsonFile, announce_compiling, app, examples
from rsc_swarm.machine.leaving import unwind_when_asked

selfcheck = typer.Typer(rich_markup_mode="rich")
app.add_typer(selfcheck, name="selfcheck", help="Try what no drone, network or machine may bring about.")


@selfcheck.callback(
    invoke_without_command=True,
    epilog=examples("selfcheck --maps 1", "selfcheck --attacks hellos,late --maps 2 --agents 9"),
)
def insiders(
    context: typer.Context,
    attacks: Annotated[
        str | None, typer.Option(metavar="A,B", help="Only these attacks by one drone. (all)")
    ] = None,
    maps: Annotated[int, typer.Option(min=1, help="Number of maps, each flown once per attack.")] = 10,
    agents: Annotated[int, typer.Option("--agents", "-n", min=3, max=100, help="Number of drones.")] = 25,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first map, and of the attacks.")] = 0,
    json: JsonFile = None,
) -> None:
    """Let one drone of a swarm, with a valid login, attack the others in every way known, in real processes.

    Passed if no other drone was ever lost, and the others succeeded in 95 of 100 flights. With --json FILE what was flown is
    kept beside it: after a stop the same command goes on from there.
    """
    if context.invoked_subcommand is not None:
        return
    announce_compiling()
    from contextlib import nullcontext
    from json import dumps

    from protocols.mission.document import MissionError, parse_mission
    from rsc_swarm.cli.output import JsonOutput
    from rsc_swarm.selfcheck.attacks import ATTACKS
    from rsc_swarm.selfcheck.table import render
    from rsc_swarm.selfcheck.trials import FinishedTrials, Trial, passes, rows, trials
    from rsc_swarm.show.progress import Meter
    from rsc_swarm.show.render import console
    from rsc_swarm.study.fingerprint import name_of

    names = attacks.split(",") if attacks else list(ATTACKS)
    if unknown := [name for name in names if name not in ATTACKS]:
        raise MissionError(f"--attacks {unknown[0]}: is none; known are {', '.join(ATTACKS)}")
    output = JsonOutput(json)
    missions = [
        parse_mission({"agents": agents, "map_seed": seed + number, "seed": 1000 * (seed + number)})
        for number in range(maps)
    ]
    journal = output.journal(name_of(agents, seed))
    book = FinishedTrials(journal) if journal else None
    total, meter, out = maps * len(names), Meter(), console(output.beside)
    tried: list[Trial] = []
    try:
        with unwind_when_asked(), closing(meter), book or nullcontext():
            meter.begin(f"{total} flights", total)
            for trial in trials(missions, names, agents - 1, seed, book):
                tried.append(trial)
                meter.draw(len(tried), f"{len(tried)} of {total} flights")
    except KeyboardInterrupt:
        out.print(render(rows(tried)))
        kept = "; they are kept, and the same command goes on from there" if book and tried else ""
        print(f"stopped after {len(tried)} of {total} flights{kept}", file=sys.stderr)
        raise typer.Exit(ExitCode.INTERRUPTED) from None
    good = passes(tried)

    def tell() -> None:
        out.print(render(rows(tried)))
        out.print("PASSED" if good else "FAILED: an honest drone was lost, or too few flights succeeded")

    output.tell(tell, dumps([trial._asdict() for trial in tried], indent=2))
    raise typer.Exit(ExitCode.SUCCEEDED if good else ExitCode.FAILED)


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
