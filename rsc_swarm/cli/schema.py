"""``rsc-swarm schema``: what the fields of reports mean."""

from enum import StrEnum
from typing import Annotated

import typer

from rsc_swarm.cli.app import app


class Report(StrEnum):
    """What is reported on."""

    flight = "flight"
    evaluation = "evaluation"


@app.command()
def schema(
    report: Annotated[Report, typer.Argument(help="Of which report.")] = Report.flight,
    markdown: Annotated[
        bool, typer.Option("--markdown", help="As tables of fields, for people; all reports.")
    ] = False,
) -> None:
    """Print what the fields of the report of a flight, or of many, mean, as JSON Schema."""
    from rsc_swarm.show import report_schema

    text = report_schema.markdown() if markdown else report_schema.json_schema(report_schema.REPORTS[report])
    typer.echo(text, nl=False)
