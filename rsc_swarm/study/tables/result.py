"""A flown table as data: the JSON that pictures and pages are made from, and the same as CSV."""

import csv
import io
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from protocols.errors import SwarmError
from protocols.foreign_file import read_file
from protocols.whole_file import write_whole
from rsc_swarm.flight.provenance import commit
from rsc_swarm.flight.report import Printable
from rsc_swarm.options import MissionOptions, command_line
from rsc_swarm.study.evaluate import Evaluation
from rsc_swarm.study.tables.rows import TABLES
from rsc_swarm.study.tables.table import Paper, Row, Table


class TableError(SwarmError, RuntimeError):
    """A table cannot be read or written; one line says why."""


class Accuracy(BaseModel):
    """How well a model foretells the expert, and how well constant velocity does: mean absolute error over the horizon, m."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    model_m: float
    constant_velocity_m: float


class RowResult(BaseModel):
    """A flown row. Rates are shares of all runs."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    key: Printable = Field(description="the words by which --rows finds the row")
    place: Printable = Field(description="where it was flown; empty if the table has one place only")
    name: Printable = Field(description="the controller")
    way: Printable = Field(description="how it was flown")
    agents: int
    policy: Printable
    paper: Paper | None = Field(description="what the paper reports: S and D in %, tau in s, MAE in 1e-4 m")
    runs: int
    success_rate: float
    success_interval: tuple[float, float]
    strict_rate: float | None = Field(
        None, description="share with the strict success; null in a row flown before it was judged"
    )
    strict_interval: tuple[float, float] | None = Field(None, description="null likewise")
    slot_error_mean_m: float | None = Field(
        None, description="mean over successful flights of the worst slot error at success; null likewise"
    )
    stood_on_rate: float | None = Field(
        None,
        description="share that succeeded as in the paper and whose formation stood for 2 s more; null likewise",
    )
    agreed_at_success_rate: float | None = Field(
        None, description="share that did so and in which all drones had one view of the slots; null likewise"
    )
    collision_rate: float
    noncollision_rate: float
    tau_mean_s: float | None
    formed_mean_s: float | None
    min_distance_m: float | None
    swaps_per_flight: float
    undone_per_flight: float | None = Field(
        None, description="swaps that a merge undid; null in a row flown before it was counted"
    )
    overlap_mean_s: float | None = Field(
        None,
        description="mean time during which drones claimed the same slot, summed over drones; null likewise",
    )
    accuracy: Accuracy | None = Field(description="null for a controller that foretells nothing")
    maps: tuple[int, int] = Field(description="first and last map seed")
    starts: int
    failures: dict[Printable, list[int]] = Field(
        description="start seeds of failed flights, by failure; map = seed // 1000"
    )
    command: Printable = Field(description="flies this row alone")
    code: Printable = Field(description="fingerprint of mission and code")
    commit: Printable | None = Field(
        None,
        description="of the checkout that flew it (rsc_swarm.flight.provenance); null likewise, or if it was no checkout",
    )


def _known(table: str) -> str:
    if table not in TABLES:
        raise ValueError(f"there is no table {table}")
    return table


class TableResult(BaseModel):
    """A table as far as it has been flown, rows in the table's order."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    table: Annotated[str, AfterValidator(_known)]
    title: Printable
    rows: Annotated[tuple[RowResult, ...], Field(min_length=1)]


def row_result(row: Row, flown: Evaluation, accuracy: Accuracy | None) -> RowResult:
    """What stands in the table for ``row``."""
    failures: dict[Printable, list[int]] = {}
    for failed in flown.failures:
        failures.setdefault(failed.failure, []).append(failed.seed)
    same = flown.model_dump(
        include=RowResult.model_fields.keys() & Evaluation.model_fields.keys() - {"failures"}
    )
    swaps = flown.swaps_per_flight
    return RowResult(
        **{**same, "swaps_per_flight": swaps["committed"] + swaps["vacated"]},
        undone_per_flight=swaps["undone"],
        key=row.key,
        place=row.place.title,
        name=row.name,
        way=row.way.title,
        agents=flown.mission["agents"],
        policy=row.policy,
        paper=row.paper,
        accuracy=accuracy,
        failures=failures,
        command=command_of(row.options, flown.maps, flown.starts),
        commit=commit(),
    )


def command_of(options: MissionOptions, maps: tuple[int, int], starts: int) -> str:
    """The command that flies a row with these ``options`` alone."""
    first, last = maps
    return command_line("evaluate", options, maps=last - first + 1, starts=starts, seed_base=first)


def merged(table: Table, old: TableResult | None, new: list[RowResult]) -> TableResult:
    """``table`` with its ``new`` rows, and of the ``old`` ones those that were not flown again."""
    rows = {row.key: row for row in [*(old.rows if old else ()), *new]}
    known = [row.key for row in table.rows]
    return TableResult(
        table=table.name, title=table.title, rows=tuple(rows[key] for key in known if key in rows)
    )


def path_of(folder: Path, table: str, ending: str = "json") -> Path:
    """The file of a table in ``folder``."""
    return folder / f"table-{table}.{ending}"


def read_table(path: Path) -> TableResult:
    """A table that was written here.

    Raises:
        TableError: the file is missing or holds something else.
    """
    try:
        return TableResult.model_validate_json(read_file(path))
    except OSError as error:
        raise TableError(f"{path}: cannot be read ({error.strerror})") from None
    except ValidationError:
        raise TableError(
            f"{path}: is not a table of this version; move it away or make it anew with evaluate --table"
        ) from None


def read_tables(folder: Path) -> list[TableResult]:
    """All tables in ``folder``.

    Raises:
        TableError: there is none, or one cannot be read.
    """
    paths = [path for name in TABLES if (path := path_of(folder, name)).is_file()]
    if not paths:
        raise TableError(f"{folder}: no table here; rsc-swarm evaluate --table 1 --out {folder} makes one")
    return [read_table(path) for path in paths]


def write_table(folder: Path, result: TableResult, markdown: str) -> None:
    """Write the table as JSON, CSV and Markdown.

    Raises:
        protocols.whole_file.WriteError: the folder cannot be written.
    """
    texts = {"json": result.model_dump_json(indent=1) + "\n", "csv": as_csv(result), "md": markdown}
    for ending, text in texts.items():
        write_whole(path_of(folder, result.table, ending), text)


def as_csv(result: TableResult) -> str:
    """One line per row; units are in the names, rates are shares, what is not known is empty."""
    lines = [_flat(row) for row in result.rows]
    text = io.StringIO()
    writer = csv.DictWriter(text, list(lines[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    return text.getvalue()


def _flat(row: RowResult) -> dict[str, object]:
    low, high = row.success_interval
    paper = asdict(row.paper) if row.paper else dict.fromkeys(Paper.__dataclass_fields__)
    return {
        **row.model_dump(
            exclude={
                "paper",
                "accuracy",
                "success_interval",
                "strict_interval",
                "maps",
                "failures",
                "command",
                "code",
                "commit",
            }
        ),
        "success_low": low,
        "success_high": high,
        "strict_low": row.strict_interval and row.strict_interval[0],
        "strict_high": row.strict_interval and row.strict_interval[1],
        "mae_m": row.accuracy and row.accuracy.model_m,
        "mae_constant_velocity_m": row.accuracy and row.accuracy.constant_velocity_m,
        **{f"paper_{name}": value for name, value in paper.items()},
        "first_map": row.maps[0],
        "last_map": row.maps[1],
        "command": row.command,
        "code": row.code,
        "commit": row.commit,
    }
