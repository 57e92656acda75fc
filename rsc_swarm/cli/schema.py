"""``rsc-swarm schema``: what the fields of a report mean."""

from typing import Annotated

import typer

from rsc_swarm.cli.app import app


@app.command()
def schema(
    markdown: Annotated[bool, typer.Option("--markdown", help="As a table of fields, for people.")] = False,
) -> None:
    """Print what the fields of a report mean, as JSON Schema."""
    from rsc_swarm.show import report_schema

    typer.echo(report_schema.markdown() if markdown else report_schema.json_schema(), nl=False)
