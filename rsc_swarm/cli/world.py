"""``rsc-swarm world``: the world alone, for drones that are started elsewhere."""

from contextlib import nullcontext
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rsc_swarm.cli.app import (
    Clock,
    FlightOptions,
    PlainText,
    announce_compiling,
    app,
    endpoints,
    examples,
    with_options,
)
from rsc_swarm.options import MissionOptions

if TYPE_CHECKING:
    from protocols.errors import ExitCode
    from rsc_swarm.cli.fly import Flight, Told


class Bodies(StrEnum):
    """What moves the drones."""

    simulated = "simulated"
    external = "external"


@dataclass(frozen=True)
class MovedBy:
    """Options that say where the bodies of the drones are."""

    bodies: Annotated[
        Bodies,
        typer.Option(
            help="simulated: the world moves the drones; external: those of a fleet file say where they are (mixed reality)."
        ),
    ] = Bodies.simulated
    fleet: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", dir_okay=False, help="With external bodies: the fleet file, with a world in it."
        ),
    ] = None


@app.command(
    epilog=examples(
        "world --listen tls/10.0.0.1:7447 --keys keys --agents 4",
        "world --listen tcp/127.0.0.1:7447 --credentials-dir logins --agents 4",
        "world --bodies external --fleet six.yaml --burst 0.3",
    )
)
@with_options
def world(
    flight: FlightOptions,
    options: MissionOptions,
    moved: MovedBy,
    listen: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT",
            callback=endpoints,
            help="Where drones reach it, tls/ADDRESS:PORT say; may be repeated.",
        ),
    ] = None,
    keys: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            exists=True,
            help="The keys that [bold]rsc-swarm keys[/] made, or world.json of them.",
        ),
    ] = None,
    credentials_dir: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Instead of --keys: where to put a file for each drone, good for this flight and without certificates.",
        ),
    ] = None,
    plain_text: PlainText = False,
    join_s: Annotated[float, typer.Option(min=1, help="How long to wait for all drones to arrive.")] = 120.0,
) -> None:
    """Run the world alone, for drones on other machines."""
    if moved.bodies is Bodies.external or moved.fleet:
        no_use = {"--listen": listen, "--keys": keys, "--credentials-dir": credentials_dir}
        if useless := [name for name, value in no_use.items() if value]:
            raise typer.BadParameter(
                f"{useless[0]}: with external bodies the fleet file says so; leave it out"
            )
        if moved.fleet is None or moved.bodies is Bodies.simulated:
            raise typer.BadParameter("--bodies external and --fleet FILE belong together; give both")
        raise typer.Exit(_external(moved.fleet, flight, options))
    if not listen:
        raise typer.BadParameter("give --listen, where drones reach it")
    if (keys is None) == (credentials_dir is None):
        raise typer.BadParameter("give either --keys, as made by 'rsc-swarm keys', or --credentials-dir")
    from rsc_swarm.flight.key_files import check_listening

    check_listening(listen, plain_text)
    announce_compiling()
    from rsc_swarm.cli.fly import fly_once

    fly = partial(_fly, listen, keys, credentials_dir, join_s)
    files = {"keys": keys, "credentials_dir": credentials_dir}
    given = {name: path.absolute() for name, path in files.items() if path}
    again = {"listen": listen, **given, **({"plain_text": True} if plain_text else {})}
    raise typer.Exit(fly_once("world", fly, flight, options, again))


def _external(file: Path, flight: FlightOptions, options: MissionOptions) -> "ExitCode":
    """Mixed reality."""
    from protocols.fleet.document import FleetError
    from rsc_swarm.air.mixed import mixed_mission
    from rsc_swarm.air.plans import asked_mission, keys_of, read_plan

    if flight.view or flight.open:
        raise typer.BadParameter("--view: watch the fleet with 'rsc-swarm ground --view'")
    plan = read_plan(file)
    if plan.fleet.world is None:
        raise FleetError(
            f"{file}: world: is missing; write 'world: {{}}', and the drones fly by this world's radio"
        )
    mission = mixed_mission(plan, asked_mission(file, plan, options))
    announce_compiling()
    from rsc_swarm.cli.fly import fly_once

    def fly(flight: "Flight") -> "Told":
        from rsc_swarm.air.mixed_process import serve_mixed
        from rsc_swarm.cli.fly import Told, told_unsaved
        from rsc_swarm.flight.alone import Watching

        place, watching = flight.folder, Watching(flight.view.update)
        flight.view.say(
            f"waiting for the fleet at {plan.fleet.world_address}; the operator's go begins the flight"
        )
        flown, unsaved = serve_mixed(
            plan, mission, keys_of(file, plan), watching, place.path if place else None
        )
        return Told(flown, save=partial(told_unsaved, unsaved))

    again = {"bodies": Bodies.external.value, "fleet": file.absolute()}
    return fly_once("world", fly, replace(flight, clock=Clock.realtime), options, again, mission)


def _fly(
    listen: list[str], keys: Path | None, logins: Path | None, join_s: float, flight: "Flight"
) -> "Told":
    from rsc_swarm.cli.fly import Told, told_unsaved
    from rsc_swarm.flight.alone import Watching, serve_world
    from rsc_swarm.flight.door import door_watched
    from rsc_swarm.flight.key_files import make_login_files, read_credentials

    mission, place = flight.mission, flight.folder
    if keys:
        credentials = read_credentials(keys, mission.swarm, mission.agents)
    else:
        assert logins
        credentials = make_login_files(logins, mission.swarm, mission.agents)
    flight.view.say(
        f"waiting for {mission.agents} agents at {', '.join(listen)}; their files are in {keys or logins}"
    )
    watching = Watching(flight.view.update, flight.gathered, flight.onlooker)
    with door_watched(flight.view.say) if keys else nullcontext():
        flown, unsaved = serve_world(
            mission, flight.clock.value, listen, credentials, watching, place.path if place else None, join_s
        )
    return Told(flown, save=partial(told_unsaved, unsaved))
