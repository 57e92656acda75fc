"""``rsc-swarm radio``: the radio host of one dongle."""

import sys
from typing import Annotated

import typer

from rsc_swarm.cli.app import app, examples
from rsc_swarm.cli.fly_alone import FleetFile


@app.command(epilog=examples("radio --fleet six.yaml --dongle 0"))
def radio(
    fleet: FleetFile,
    dongle: Annotated[
        int | None,
        typer.Option(metavar="N", min=0, help="Which Crazyradio; not needed where the fleet has one."),
    ] = None,
) -> None:
    """Lead the Crazyflies of one dongle for their drones, until asked to leave. [bold]rsc-swarm air[/] starts these itself."""
    from rsc_swarm.air.plans import read_plan
    from rsc_swarm.air.radios import be_host, radio_of

    host = radio_of(read_plan(fleet), dongle)
    for doubt in host.doubts:
        print(f"rsc-swarm: {doubt}", file=sys.stderr)
    be_host(host)
