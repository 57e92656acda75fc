"""What the fields of reports mean: JSON Schema for programs, Markdown tables for people (docs/report.md)."""

import json
import types
import typing

from pydantic import BaseModel

from rsc_swarm.flight.report import FlightReport
from rsc_swarm.study.evaluate import Evaluation

_HEAD = """# The report of a flight

`rsc-swarm simulate --json FILE` and `rsc-swarm launch --json FILE` write one JSON object with these fields;
in a run directory it is `report.json`. This page is made by `rsc-swarm schema --markdown`; `rsc-swarm schema`
prints the same as JSON Schema.

"""
_MANY = """
## Many flights

`rsc-swarm evaluate --json FILE` writes these, and `rs.evaluate` returns them ([api.md](api.md)); `rsc-swarm schema evaluation`
prints the same as JSON Schema.

"""
REPORTS: dict[str, type[BaseModel]] = {"flight": FlightReport, "evaluation": Evaluation}


def json_schema(of: type[BaseModel]) -> str:
    """JSON Schema of a report."""
    return json.dumps(of.model_json_schema(), indent=2) + "\n"


def markdown() -> str:
    """The fields of all reports as a Markdown document."""
    return _HEAD + _table(FlightReport) + _MANY + _table(Evaluation)


def _table(model: type[BaseModel]) -> str:
    return "\n".join(["| field | type | meaning |", "| --- | --- | --- |", *_rows(model, "")]) + "\n"


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
    if origin is typing.Annotated:
        return _type(inner[0])
    if origin is typing.Literal:
        return ", ".join(f"`{value}`" for value in inner)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(_type(part) for part in inner)
    if origin in (tuple, list):
        return f"list of {_type(inner[0])}s"
    return "object"
