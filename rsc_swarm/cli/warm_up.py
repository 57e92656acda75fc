"""``rsc-swarm warm-up``: compile everything ahead."""

from typing import Annotated

import typer

from rsc_swarm.cli.app import app, examples


@app.command("warm-up", epilog=examples("warm-up", "warm-up --shared"))
def warm_up(
    shared: Annotated[
        bool,
        typer.Option(
            "--shared",
            help="For whoever uses this installation: keep it there, not in your own cache.",
        ),
    ] = False,
) -> None:
    """Compile all rules now, so that no flight waits for it: when a container is built, in CI, before a drone goes out."""
    from rsc_swarm.cli.compiling import compile_all

    place = ""
    if shared:
        from protocols.kept import ship

        place = f", in {ship()}"
    compile_all()
    typer.echo(f"all rules are compiled{place}")
