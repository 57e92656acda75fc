"""``rsc-swarm replay``: a flight of a run directory in the browser, with time in one's hand."""

import time
from pathlib import Path
from typing import Annotated

import typer

from protocols.errors import ExitCode
from rsc_swarm.cli.app import OpenBrowser, ViewHost, ViewPort, announce_compiling, app, examples


@app.command(epilog=examples("replay flights/2", "replay flights/2 --open"))
def replay(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run directory, as --run-dir makes it.")],
    open: OpenBrowser = False,
    view_port: ViewPort = None,
    view_host: ViewHost = "127.0.0.1",
) -> None:
    """Watch a flight again in the browser, back and forth, until Ctrl-C."""
    announce_compiling()
    from rsc_swarm.flight.run_dir import RunDir
    from rsc_swarm.machine.leaving import leave_when_asked
    from rsc_swarm.show.progress import Meter
    from rsc_swarm.watch.replay import replay_of
    from rsc_swarm.watch.site import Asked, served

    meter = Meter()
    meter.begin(f"flying {run} again")
    try:
        shown = replay_of(
            RunDir(run), lambda share: meter.draw(share, f"flying {run} again") if meter.due() else None
        )
    finally:
        meter.close()
    with leave_when_asked() as leave, served(Asked(view_host, view_port, open), hands=False) as site:
        site.window.say({"kind": "scene", "scene": shown.scene})
        site.window.say({"kind": "replay", "recorded": shown.recorded})
        if shown.report:
            site.window.say({"kind": "report", "report": shown.report})
        for picture in shown.pictures:
            site.window.give(picture)
        if shown.recorded:
            typer.echo(f"as it was recorded, without radio and beliefs: {shown.recorded}", err=True)
        typer.echo(f"watch it at {site.address}; Ctrl-C ends", err=True)
        while not leave.asked:
            time.sleep(0.1)
    raise typer.Exit(ExitCode.SUCCEEDED)
