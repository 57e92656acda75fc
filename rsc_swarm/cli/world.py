"""``rsc-swarm world``: the world alone, for drones that are started elsewhere."""

from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rsc_swarm.cli.app import FlightOptions, PlainText, announce_compiling, app, examples, with_options
from rsc_swarm.options import MissionOptions

if TYPE_CHECKING:
    from rsc_swarm.cli.fly import Flight, Told


@app.command(
    epilog=examples(
        "world --listen tls/10.0.0.1:7447 --keys keys --agents 4",
        "world --listen tcp/127.0.0.1:7447 --credentials-dir logins --agents 4",
    )
)
@with_options
def world(
    flight: FlightOptions,
    options: MissionOptions,
    listen: Annotated[
        list[str],
        typer.Option(
            metavar="ENDPOINT", help="Where drones reach it, tls/ADDRESS:PORT say; may be repeated."
        ),
    ],
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
