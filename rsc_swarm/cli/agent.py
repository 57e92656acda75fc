"""``rsc-swarm agent``: one drone alone, as on its companion computer."""

from pathlib import Path
from typing import Annotated

import typer

from protocols.errors import ExitCode
from protocols.wire.keys import MAX_AGENTS
from rsc_swarm.cli.app import PlainText, announce_compiling, app, endpoints, examples

Connect = Annotated[
    str,
    typer.Option(
        metavar="ENDPOINT", callback=endpoints, help="Where the world listens, tls/ADDRESS:PORT say."
    ),
]
Policy = Annotated[
    str,
    typer.Option(metavar="NAME", help="Controller of the drone, as in launch; the world has no say."),
]


@app.command(epilog=examples("agent --agent 0 --connect tls/10.0.0.1:7447 --credentials agent-0.json"))
def agent(
    agent: Annotated[int, typer.Option(metavar="I", min=0, max=MAX_AGENTS - 1, help="Which drone this is.")],
    connect: Connect,
    credentials: Annotated[
        Path,
        typer.Option(
            metavar="FILE",
            exists=True,
            dir_okay=False,
            help="This drone's own, made by [bold]rsc-swarm keys[/] or the world.",
        ),
    ],
    policy: Policy = "rsc-h20",
    plain_text: PlainText = False,
) -> None:
    """Run one drone alone; it gets its mission from the world, and flies its own policy."""
    from rsc_swarm.flight.key_files import read_login

    login = read_login(credentials, agent, connect, plain_text)
    announce_compiling()
    from agent.body.relayed import Ending
    from rsc_swarm.flight.alone import fly_agent

    def say(seconds: float) -> None:
        typer.echo(f"agent {agent}: ready after {seconds:.2f} s", err=True)

    reason = fly_agent(login, connect, policy, say)
    typer.echo(f"agent {agent}: {reason}", err=True)
    raise typer.Exit(ExitCode.INTERRUPTED if reason is Ending.ASKED_TO_LEAVE else ExitCode.SUCCEEDED)
