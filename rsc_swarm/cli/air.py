"""``rsc-swarm air``: all drones of a fleet from one machine, each a process of its own."""

from pathlib import Path
from typing import Annotated

import typer

from rsc_swarm.cli.app import announce_compiling, app, examples
from rsc_swarm.cli.fly_alone import FleetFile


@app.command(epilog=examples("air --fleet six.yaml", "air --fleet six.yaml --run-dir flights"))
def air(
    fleet: FleetFile,
    run_dir: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Keep each flight as each drone saw it: DIR/drone-0/1, ..."),
    ] = None,
    trouble: Annotated[
        list[str] | None,
        typer.Option(metavar="I:WHAT", help="As for [bold]fly[/], for drone I; may be repeated."),
    ] = None,
) -> None:
    """Start a process for each drone of a fleet, and watch over them until asked to leave. Orders: [bold]rsc-swarm ground[/]."""
    from agent.air.trouble import Trouble, TroubleError
    from rsc_swarm.air.plans import keys_of, read_plan
    from rsc_swarm.air.radios import check_addresses_free

    plan = read_plan(fleet)
    keys, troubles = keys_of(fleet, plan), {}
    for each in trouble or ():
        number, _, what = each.partition(":")
        if not number.isdecimal() or int(number) >= plan.mission.agents:
            raise TroubleError(f"--trouble {each}: write the drone's number first, for example 3:loss=0.3")
        troubles[int(number)] = Trouble.parse(what)
    check_addresses_free(plan)
    announce_compiling()
    from rsc_swarm.air.processes import fly_all

    raise typer.Exit(fly_all(plan, keys, run_dir, troubles))
