"""``rsc-swarm fly``: one drone on the air, as on its companion computer."""

from pathlib import Path
from typing import Annotated

import typer

from rsc_swarm.cli.app import announce_compiling, app, examples

FleetFile = Annotated[
    Path,
    typer.Option("--fleet", metavar="FILE", dir_okay=False, help="Fleet file: who flies what in which room."),
]


@app.command(
    epilog=examples(
        "fly --agent 3 --fleet field.yaml",
        "fly --agent 3 --fleet field.yaml --body mavlink:udpin:127.0.0.1:14550",
    )
)
def fly(
    fleet: FleetFile,
    agent: Annotated[int, typer.Option(metavar="I", min=0, help="Which drone of the fleet this is.")],
    body: Annotated[
        str | None, typer.Option(metavar="KIND:WHERE", help="Its vehicle, instead of that in the fleet file.")
    ] = None,
    credentials: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            dir_okay=False,
            help="Its own file of keys, instead of that in the folder the fleet file names.",
        ),
    ] = None,
    run_dir: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Keep each flight as this drone saw it: DIR/1, DIR/2, ..."),
    ] = None,
    trouble: Annotated[
        str,
        typer.Option(
            metavar="WHAT",
            help="What is to go wrong, to see what happens then: loss=0.3,clock=50ms,deaf=3-8.",
        ),
    ] = "",
) -> None:
    """Fly one drone on the air, without a world: its vehicle, the others it hears, and the operator's orders."""
    from agent.air.trouble import Trouble
    from rsc_swarm.air.plans import key_file_of, read_plan

    plan, asked = read_plan(fleet), Trouble.parse(trouble)
    announce_compiling()
    from rsc_swarm.air.alone import fly_drone

    fly_drone(plan, agent, key_file_of(fleet, plan, agent, credentials), body, run_dir, asked)
