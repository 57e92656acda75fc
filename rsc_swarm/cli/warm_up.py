"""``rsc-swarm warm-up``: compile everything ahead."""

import typer

from rsc_swarm.cli.app import app, examples


@app.command("warm-up", epilog=examples("warm-up"))
def warm_up() -> None:
    """Compile all rules now, so that no flight waits for it: when a container is built, in CI, before a drone goes out."""
    from rsc_swarm.cli.compiling import compile_all

    compile_all()
    typer.echo("all rules are compiled")
