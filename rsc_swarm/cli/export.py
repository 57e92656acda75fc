"""``rsc-swarm export``: a recorded flight as a file that other programs open."""

from pathlib import Path
from typing import Annotated

import typer

from rsc_swarm.cli.app import announce_compiling, app, examples
from rsc_swarm.cli.report import Run


@app.command(epilog=examples("export flights/1 --mcap flight.mcap"))
def export(
    run: Run,
    mcap: Annotated[
        Path,
        typer.Option(metavar="FILE", help="MCAP, for Foxglove, Rerun and PlotJuggler.", show_default=False),
    ],
) -> None:
    """Write a recorded flight as a file that other programs open."""
    announce_compiling()
    from rsc_swarm.flight.recorded import Recorded
    from rsc_swarm.flight.run_dir import RunDir
    from rsc_swarm.show.foxglove.file import write_mcap

    recorded = Recorded.load(RunDir(run))
    write_mcap(recorded, mcap)
    print(f"{mcap}: {recorded.verdict}")
