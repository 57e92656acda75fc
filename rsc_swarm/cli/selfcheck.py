"""``rsc-swarm selfcheck``: whether this machine and this installation keep what they promise, one command a check."""

import typer

from rsc_swarm.cli.app import app

selfcheck = typer.Typer(help="Try what no drone, network or machine may bring about.")
app.add_typer(selfcheck, name="selfcheck")


@selfcheck.callback(invoke_without_command=True)
def insiders(context: typer.Context) -> None:
    """Try what no drone, network or machine may bring about."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())
