"""``rsc-swarm world``: the world alone, for drones that are started elsewhere."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rsc_swarm.cli.app import FlightOptions, announce_compiling, app, examples, with_options
from rsc_swarm.options import MissionOptions

if TYPE_CHECKING:
    from rsc_swarm.cli.fly import Flight, Told


@app.command(epilog=examples("world --listen tcp/0.0.0.0:7447 --credentials-dir keys --agents 4"))
@with_options
def world(
    flight: FlightOptions,
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
    join_s: Annotated[float, typer.Option(min=1, help="How long to wait for all drones to arrive.")] = 120.0,
) -> None:
    """Run the world alone, for drones on other machines."""
    announce_compiling()
    from rsc_swarm.cli.fly import fly_once

    fly = partial(_fly, listen, credentials_dir, join_s)
    again = {"listen": listen, "credentials_dir": credentials_dir.absolute()}
    raise typer.Exit(fly_once("world", fly, flight, options, again))


def _fly(listen: list[str], credentials: Path, join_s: float, flight: "Flight") -> "Told":
    from rsc_swarm.cli.fly import Told, told_unsaved
    from rsc_swarm.flight.launch import serve_world

    mission, place = flight.mission, flight.folder
    flight.view.say(
        f"waiting for {mission.agents} agents at {', '.join(listen)}; credentials are in {credentials}"
    )
    trajectory = place.trajectory if place else None
    flown, unsaved = serve_world(
        mission, flight.clock.value, listen, credentials, flight.view.update, trajectory, join_s
    )
    return Told(flown, save=partial(told_unsaved, unsaved))
