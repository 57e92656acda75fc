"""``rsc-swarm agents``: many drones on one host, a process each."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rsc_swarm.cli.agent import Connect, Policy
from rsc_swarm.cli.app import PlainText, announce_compiling, app, examples

if TYPE_CHECKING:
    from rsc_swarm.flight.agents import Ended


@app.command(
    epilog=examples(
        "agents 0-24 --connect tls/10.0.0.1:7447 --credentials-dir keys",
        "agents 0-11,13 --connect tls/10.0.0.1:7447 --credentials-dir keys --policy analytic",
    )
)
def agents(
    numbers: Annotated[str, typer.Argument(metavar="NUMBERS", help="Which drones these are: 0-11,13 say.")],
    connect: Connect,
    credentials_dir: Annotated[
        Path,
        typer.Option(
            metavar="DIR",
            exists=True,
            file_okay=False,
            help="Where their files are, agent-0.json and so on, made by [bold]rsc-swarm keys[/] or the world.",
        ),
    ],
    policy: Policy = "rsc-h20",
    join_s: Annotated[float, typer.Option(min=1, help="How long to look for the world.")] = 60.0,
    plain_text: PlainText = False,
) -> None:
    """Run many drones on one host, a process each; they get their mission from the world, and fly their own policy."""
    from rsc_swarm.flight.key_files import read_logins
    from rsc_swarm.flight.ranges import numbers_in

    logins = read_logins(credentials_dir, numbers_in(numbers), connect, plain_text)
    announce_compiling()
    from rsc_swarm.flight.agents import fly_agents
    from rsc_swarm.flight.ranges import written

    flying, ended = {login.agent for login in logins}, dict[str, list[int]]()

    def tell_ready(seconds: float) -> None:
        typer.echo(f"{_named(written(flying))}: ready after {seconds:.2f} s", err=True)

    def tell_end(end: "Ended") -> None:
        flying.discard(end.agent)
        known = ended.setdefault(end.why, [])
        known.append(end.agent)
        if end.code and flying and len(known) == 1:
            typer.echo(f"agent {end.agent}: {end.why}; the others go on", err=True)

    code = fly_agents(logins, connect, policy, join_s, tell_ready, tell_end)
    if flying:
        ended.setdefault("asked to leave", []).extend(flying)
    for why, drones in ended.items():
        typer.echo(f"{_named(written(drones))}: {why}", err=True)
    raise typer.Exit(code)


def _named(numbers: str) -> str:
    return f"agent {numbers}" if numbers.isdecimal() else f"agents {numbers}"
