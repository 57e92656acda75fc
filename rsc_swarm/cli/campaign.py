"""``rsc-swarm campaign``: random faults within a budget, and what they break."""

import sys
import time
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from protocols.errors import ExitCode
from rsc_swarm.cli.app import WhoOptions, announce_compiling, app, examples, refuse_besides, with_options
from rsc_swarm.machine.leaving import unwind_when_asked
from rsc_swarm.options import MissionOptions, command_line, named, resolve

if TYPE_CHECKING:
    from rsc_swarm.campaign.flying import Plan, Tally
    from rsc_swarm.study.machines import Who


@dataclass(frozen=True)
class KeptOptions:
    """Options that say which kept missions are flown instead."""

    check: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Fly the missions in this folder, and nothing else: does one break?"
        ),
    ] = None
    replay: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Fly this kept mission in processes, and nothing else."),
    ] = None


@app.command(
    epilog=examples(
        "campaign plain --agents 9 --flights 1000",
        "campaign --mission scrambled --budget kill=2,part=2,burst=0.5 --seed 7",
        "campaign dense --budget none,restart=3",
        "campaign --check campaigns/plain-0",
        "campaign --replay campaigns/plain-0/drones-hit-each-other/1000017-1000203-a483f2cd.yaml",
    )
)
@with_options
def campaign(
    context: typer.Context,
    options: MissionOptions,
    who: WhoOptions,
    kept: KeptOptions,
    name: Annotated[str | None, typer.Argument(metavar="MISSION", help="The same as --mission.")] = None,
    budget: Annotated[
        str | None,
        typer.Option(
            metavar="NAME=MOST,...",
            help="At most so much in one flight, instead of the usual; [bold]none[/] first: instead of nothing.",
        ),
    ] = None,
    flights: Annotated[int, typer.Option(min=1, help="How many.")] = 1000,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Where missions that broke something, and an index of them, go. (campaigns/MISSION-SEED)",
        ),
    ] = None,
) -> None:
    """Fly a mission many times, each time with other faults; shrink what breaks to the shortest mission that still does.

    --seed is the seed of it all: the same campaign draws the same flights.
    """
    from protocols.mission.document import MissionError

    if kept.replay:
        refuse_besides(context, "--replay")
    if kept.check:
        refuse_besides(context, "--check", "workers", "on")
    options = named(options, name)
    try:
        import hypothesis  # noqa: F401
    except ModuleNotFoundError:
        raise MissionError(
            "a campaign needs hypothesis: pip install -e '.[campaign]', in the clone of rsc-swarm"
        ) from None
    announce_compiling()
    if kept.replay:
        raise typer.Exit(_replay(kept.replay))
    if kept.check:
        raise typer.Exit(_check(kept.check, who.checked()))
    raise typer.Exit(_fly(options, budget, flights, out, who.checked()))


def _fly(options: MissionOptions, budget: str | None, flights: int, out: Path | None, who: "Who") -> ExitCode:
    from protocols.mission.document import MissionError
    from rsc_swarm.campaign.budget import parse_budget, ready
    from rsc_swarm.campaign.campaign import fly
    from rsc_swarm.campaign.flying import Plan, Tally
    from rsc_swarm.show.progress import Meter
    from rsc_swarm.study.machines import crew_of

    if options.map is not None:
        raise MissionError("--map: a campaign draws the maps; leave it out")
    mission = resolve(replace(options, seed=None))
    plan = Plan(mission, parse_budget(budget), options.seed or 0, flights)
    ready(mission, plan.budget)
    folder = out or Path("campaigns") / f"{mission.name}-{plan.seed}"
    seen, begin = Tally(), time.monotonic()
    meter = Meter()

    def told(tally: "Tally", shrinking: int) -> None:
        nonlocal seen
        seen = tally
        if meter.due() or shrinking:
            meter.draw(tally.flights / flights, _progress(tally, flights, shrinking))

    try:
        with unwind_when_asked(), closing(meter), crew_of(who) as crew:
            meter.begin(f"{flights} flights")
            tally = fly(plan, crew, folder, told)
    except KeyboardInterrupt:
        said = _progress(seen, flights, 0)
        print(
            f"stopped after {said}; they are kept in {folder}, and the same command goes on from there",
            file=sys.stderr,
        )
        return ExitCode.INTERRUPTED
    again = command_line("campaign", options, budget=str(plan.budget), flights=flights)
    return _tell(plan, tally, folder, again, time.monotonic() - begin)


def _progress(tally: "Tally", flights: int, shrinking: int) -> str:
    text = f"{tally.flights} of {flights} flights, {len(tally.failures) or 'none'} broke something"
    return f"{text}, shrinking {shrinking}" if shrinking else text


def _tell(plan: "Plan", tally: "Tally", folder: Path, again: str, seconds: float) -> ExitCode:
    """Keep what broke, tell the story of each flight that was made short, and say so."""
    from rsc_swarm.api import simulate, write_report
    from rsc_swarm.campaign.campaign import groups
    from rsc_swarm.campaign.kept import keep, replay_command
    from rsc_swarm.campaign.page import write_index
    from rsc_swarm.study.intervals import failure_bound

    found = groups(tally)
    places = {failure.digest: keep(failure, folder) for group in found for failure in group.failures}
    for failure in tally.failures:
        page = places[failure.digest].with_suffix(".html")
        if failure.shrunk and not page.exists():
            write_report(simulate(failure.mission), page)
    index = write_index(folder, plan, tally, places, again)
    unsafe = sum(failure.broken.safety for failure in tally.failures)
    print(
        f"{plan.mission.name}, {plan.mission.agents} drones, seed {plan.seed}: {tally.flights} flights in {seconds:.0f} s, "
        f"{unsafe or 'none'} unsafe, {len(tally.failures) - unsafe or 'none'} not alive, {tally.excused} excused."
    )
    print(f"Budget: {plan.budget}")
    if not tally.failures:
        print(
            f"Nothing broke: less than {100 * failure_bound(tally.flights):.2g} % of such flights do (95 %)."
        )
    for group in found:
        shortest = group.failures[0]
        print(
            f"\n{group.name}: {len(group.failures)}, the shortest with {len(shortest.mission.faults)} faults"
        )
        print(f"  {shortest.broken.detail}")
        print(f"  {replay_command(places[shortest.digest])}")
    print(f"\n{index}")
    return ExitCode.FAILED if tally.failures else ExitCode.SUCCEEDED


def _check(folder: Path, who: "Who") -> ExitCode:
    from rsc_swarm.campaign.kept import all_kept, fly_kept
    from rsc_swarm.study.machines import crew_of
    from rsc_swarm.study.workers import executor_of

    kept = all_kept(folder)
    broken = 0
    if kept:
        with unwind_when_asked(), crew_of(who) as crew, executor_of(crew, kept[0].mission) as executor:
            for flown in executor.map(fly_kept, kept):
                broken += flown.broken is not None
                print(flown, flush=True)
    print(f"{len(kept)} missions, {broken or 'none'} broke something")
    return ExitCode.FAILED if broken else ExitCode.SUCCEEDED


def _replay(path: Path) -> ExitCode:
    from rsc_swarm.api import launch
    from rsc_swarm.campaign.kept import read_kept
    from rsc_swarm.show.render import console, render

    kept = read_kept(path)
    flight = launch(kept.mission)
    console().print(render(flight.report))
    if kept.digest:
        print("\n" + kept.compared(flight.report.digest))
    return ExitCode.SUCCEEDED if flight.report.success else ExitCode.FAILED
