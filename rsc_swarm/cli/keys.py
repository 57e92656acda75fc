"""``rsc-swarm keys``: the keys of a swarm, made once for all its flights."""

from pathlib import Path
from typing import Annotated

import typer

from rsc_swarm.cli.app import app, examples, refuse_besides


@app.command(
    epilog=examples(
        "keys keys --fleet six.yaml", "keys keys --agents 25 --world 10.0.0.1 --world swarm.example.org"
    )
)
def keys(
    context: typer.Context,
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Where to put a file for the world and one for each drone.")
    ],
    agents: Annotated[int, typer.Option(metavar="N", min=1, help="For how many drones.")] = 25,
    world: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ADDRESS",
            help="An IP address or host name of the world, for drones on other machines; may be repeated.",
        ),
    ] = None,
    fleet: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="For the drones and the operator of this fleet file instead, at their addresses.",
        ),
    ] = None,
    swarm: Annotated[str, typer.Option(metavar="NAME", help="The swarm, as missions call it.")] = "rsc",
    days: Annotated[int, typer.Option(min=1, max=3650, help="How long they are good for.")] = 365,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace the keys in DIR; no old one is good any more.")
    ] = False,
) -> None:
    """Make the keys of a swarm, once for all its flights: certificates and passwords for the world and for every drone."""
    if fleet:
        refuse_besides(context, "--fleet", "folder", "days", "overwrite")
        _fleet_keys(folder, fleet, days, overwrite)
        return
    from rsc_swarm.flight.key_files import HERE, make_key_files

    addresses = list(dict.fromkeys([*(world or ()), *HERE]))
    make_key_files(folder, swarm, agents, addresses, days, overwrite)
    typer.echo(
        f"{folder}: world.json is for the world, agent-0.json for drone 0 and nobody else, and so on; good for {days} days, "
        f"with the world at {', '.join(addresses)}"
    )


def _fleet_keys(folder: Path, file: Path, days: int, overwrite: bool) -> None:
    from protocols.fleet.document import host_of
    from rsc_swarm.air.plans import read_plan
    from rsc_swarm.flight.key_files import make_fleet_key_files
    from world.server.credentials import FleetHosts

    plan = read_plan(file)
    fleet, agents = plan.fleet, plan.mission.agents
    world = host_of(fleet.world_address) if fleet.world_address else None
    drones = [host_of(fleet.address(agent)) for agent in range(agents)]
    hosts = FleetHosts(drones, host_of(fleet.ground_address), world)
    make_fleet_key_files(folder, plan.mission.swarm, hosts, days, overwrite)
    of_world = "; mixed.json for the world" if world else ""
    typer.echo(
        f"{folder}: ground.json is for the operator, agent-0.json for drone 0 and nobody else, and so on{of_world}; good for "
        f"{days} days. Write keys: {folder.name} into {file}, if it lies beside it"
    )
