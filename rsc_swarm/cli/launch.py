"""``rsc-swarm launch``: the world and every drone as processes of their own."""

from functools import partial
from typing import TYPE_CHECKING

import typer

from rsc_swarm.cli.app import FlightOptions, announce_compiling, app, examples, with_options
from rsc_swarm.options import MissionOptions

if TYPE_CHECKING:
    from rsc_swarm.cli.fly import Flight, Told


@app.command(
    epilog=examples(
        "launch", "launch --agents 100 --clock realtime", "launch --mission restart --run-dir flights/2"
    )
)
@with_options
def launch(flight: FlightOptions, options: MissionOptions) -> None:
    """Fly once, for real: the world and every drone as processes of their own that talk over Zenoh."""
    announce_compiling()
    from rsc_swarm.cli.fly import fly_once

    raise typer.Exit(fly_once("launch", _fly, flight, options))


def _fly(flight: "Flight") -> "Told":
    from rsc_swarm.cli.fly import Told, told_unsaved
    from rsc_swarm.flight.launch import launch
    from rsc_swarm.flight.world_process import Inside

    place = flight.folder.path if flight.folder else None
    launched = launch(
        flight.mission, flight.clock.value, place, flight.view.update, weigh=True,
        inside=Inside(flight.keep, flight.onlooker), on_gathered=flight.gathered,
    )  # fmt: skip
    unsaved = partial(told_unsaved, launched.unsaved)
    return Told(launched.flown, launched.first_tick_s, launched.pss_mb, unsaved, launched.error)
