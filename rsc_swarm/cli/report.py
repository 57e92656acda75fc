"""``rsc-swarm report``: a recorded flight as one HTML file."""

from pathlib import Path
from typing import Annotated

import typer

from rsc_swarm.cli.app import announce_compiling, app, examples

Run = Annotated[
    Path, typer.Argument(metavar="RUN", help="A flight that --run-dir has kept.", show_default=False)
]


@app.command(epilog=examples("report flights/1", "report flights/1 --out flight.html"))
def report(
    run: Run,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Page to write. (RUN/report.html)", show_default=False)
    ] = None,
) -> None:
    """Write the story of a recorded flight as one HTML file: what happened and why, the map, curves, how to fly it again."""
    announce_compiling()
    from rsc_swarm.flight.recorded import Recorded
    from rsc_swarm.flight.run_dir import RunDir
    from rsc_swarm.show.page.page import write_page

    folder = RunDir(run)
    recorded = Recorded.load(folder)
    page = out or folder.page
    write_page(recorded, page)
    print(f"{page}: {recorded.end.text}")
