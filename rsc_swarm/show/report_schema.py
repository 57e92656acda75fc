"""The report's schema: JSON Schema for programs, a Markdown table for people (docs/report.md)."""

import json
import types
import typing

from pydantic import BaseModel

from rsc_swarm.flight.report import FlightReport

_HEAD = """# The report of a flight

`rsc-swarm simulate --json FILE` and `rsc-swarm launch --json FILE` write one JSON object with these fields;
in a run directory it is `report.json`. This page is made by `rsc-swarm schema --markdown`; `rsc-swarm schema`
prints the same as JSON Schema.

| field | type | meaning |
| --- | --- | --- |
"""


def json_schema() -> str:
    """JSON Schema of the report."""
    return json.dumps(FlightReport.model_json_schema(), indent=2) + "\n"


def markdown() -> str:
    """The report's fields as a Markdown document."""
    return _HEAD + "".join(f"{row}\n" for row in _rows(FlightReport, ""))


def _rows(model: type[BaseModel], prefix: str) -> list[str]:
    rows = []
    for name, field in model.model_fields.items():
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            about = " ".join((kind.__doc__ or "").split())
            rows.append(f"| `{prefix}{name}` | object | {about} |")
            rows += _rows(kind, f"{prefix}{name}.")
        else:
            rows.append(f"| `{prefix}{name}` | {_type(kind)} | {field.description or ''} |")
    return rows


_NAMES = {bool: "true or false", int: "integer", float: "number", str: "text", types.NoneType: "null"}


def _type(kind: object) -> str:
    """A type as people read it."""
    if isinstance(kind, type) and kind in _NAMES:
        return _NAMES[kind]
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Literal:
        return ", ".join(f"`{value}`" for value in inner)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(_type(part) for part in inner)
    if origin is tuple:
        return f"list of {_type(inner[0])}s"
    return "object"
