"""``rsc-swarm simulate``: the whole swarm in this one process."""

from typing import TYPE_CHECKING

import typer

from rsc_swarm.cli.app import Clock, FlightOptions, announce_compiling, app, examples, with_options
from rsc_swarm.options import MissionOptions

if TYPE_CHECKING:
    from agent.policy import PolicyError
    from rsc_swarm.cli.fly import Flight, Told


@app.command(
    epilog=examples(
        "simulate --agents 36 --map 8",
        "simulate --mission poor-radio-50 --json - | jq .tau_s",
        "simulate --swap off --set start.scrambled=true --run-dir flights/1",
    )
)
@with_options
def simulate(flight: FlightOptions, options: MissionOptions) -> None:
    """Fly once, the whole swarm in this one process: fastest, and bit for bit the flight of launch."""
    announce_compiling()
    from rsc_swarm.cli.fly import fly_once

    raise typer.Exit(fly_once("simulate", _fly, flight, options))


def _fly(flight: "Flight") -> "Told":
    from rsc_swarm.cli.fly import Told
    from rsc_swarm.flight.events import end_of
    from rsc_swarm.flight.in_process import fly
    from world.outlets.recorder import Recorder

    mission, folder = flight.mission, flight.folder
    recorder = Recorder(mission) if folder else None
    wrong: list[PolicyError] = []
    realtime = flight.clock is Clock.realtime
    flown = fly(mission, realtime, flight.view.update, recorder, wrong.append, flight.onlooker)

    def save() -> None:
        if folder and recorder:
            folder.save_path(recorder.trajectory, recorder.mission, end_of(flown, mission))

    return Told(flown, save=save, error=wrong[0] if wrong else None)
