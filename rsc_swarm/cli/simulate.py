"""``rsc-swarm simulate``: the whole swarm in this one process."""

from typing import TYPE_CHECKING

import typer

from rsc_swarm.cli.app import ClockOption, JsonFile, RunFolder, announce_compiling, app, examples
from rsc_swarm.cli.options import Clock, MissionOptions, with_options

if TYPE_CHECKING:
    from rsc_swarm.cli.fly import Flight, Told


@app.command(
    epilog=examples(
        "simulate --agents 36 --map 8",
        "simulate --mission poor-radio-50 --json - | jq .tau_s",
        "simulate --swap off --set start.scrambled=true --run-dir flights/1",
    )
)
@with_options
def simulate(
    options: MissionOptions,
    clock: ClockOption = Clock.lockstep,
    json: JsonFile = None,
    run_dir: RunFolder = None,
) -> None:
    """Fly once, the whole swarm in this one process: fastest, and bit for bit the flight of launch."""
    announce_compiling()
    from rsc_swarm.cli.fly import fly_once

    raise typer.Exit(fly_once("simulate", _fly, options, clock, json, run_dir))


def _fly(flight: "Flight") -> "Told":
    from rsc_swarm.cli.fly import Told
    from rsc_swarm.flight.in_process import fly

    trajectory = flight.folder.trajectory if flight.folder else None
    return Told(fly(flight.mission, flight.clock is Clock.realtime, flight.view.update, trajectory))
