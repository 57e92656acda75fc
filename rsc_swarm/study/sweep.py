"""Degradation curves: a mission evaluated over a grid of values of some of its fields."""

import csv
import io
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from protocols.errors import SwarmError
from protocols.mission.document import Mission, MissionError
from protocols.mission.reading import ReadingError, read_yaml, write_value
from protocols.whole_file import write_whole
from rsc_swarm.options import MissionOptions, resolve
from rsc_swarm.study.evaluate import Evaluation, evaluate, summarise
from rsc_swarm.study.fingerprint import fingerprint
from rsc_swarm.study.finished import journal_path
from rsc_swarm.study.machines import Crew
from rsc_swarm.study.progress import TICKS_GUESS, Flights, Meter
from rsc_swarm.study.workers import Seeds

_MOST = 1000  # points


class SweepError(SwarmError, RuntimeError):
    """The folder of a sweep cannot be used; one line says why."""


@dataclass(frozen=True)
class Axis:
    """One field of the mission, by its dotted name, and the values it takes."""

    field: str
    values: tuple[Any, ...]


class Point(BaseModel):
    """One point of the grid: the values of the swept fields, and what the flights there add up to."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    at: dict[str, Any]
    result: Evaluation


@dataclass(frozen=True)
class Job:
    """A point that is to be flown."""

    at: dict[str, Any]
    mission: Mission


def parse_axis(text: str) -> Axis:
    """``radio.burst.loss=0:0.9:0.1`` (from, to and with it, step) or ``radio.frame_rate_hz=5,10,25``.

    Raises:
        MissionError: one line says what would be right.
    """
    field, equals, given = text.partition("=")
    wrong = MissionError(f"--over {text}: write FIELD=FIRST:LAST:STEP or FIELD=VALUE,VALUE,...")
    if not (field and equals and given):
        raise wrong
    if given.count(":") != 2:
        try:
            return Axis(field, tuple(read_yaml(word) for word in given.split(",")))
        except ReadingError as error:
            raise MissionError(f"--over {field}: a value {error}") from None
    try:
        first, last, step = (float(word) for word in given.split(":"))
    except ValueError:
        raise wrong from None
    if not (step > 0 and first <= last and (last - first) / step < _MOST):
        raise MissionError(
            f"--over {text}: give a first value, a last one that is no smaller, and a step above 0"
        )
    whole = all(word.lstrip("-").isdigit() for word in given.split(":"))
    values = [round(first + number * step, 10) for number in range(int((last - first) / step + 1e-9) + 1)]
    return Axis(field, tuple(int(value) if whole else value for value in values))


def prepare(options: MissionOptions, axes: list[Axis]) -> list[Job]:
    """Every point of the grid, the last axis fastest, before any is flown.

    Raises:
        MissionError: one of them cannot be flown.
    """
    if len({axis.field for axis in axes}) < len(axes):
        raise MissionError("--over: names a field twice; give its values once")
    grid = [
        dict(zip([axis.field for axis in axes], values, strict=True))
        for values in product(*(axis.values for axis in axes))
    ]
    if len(grid) > _MOST:
        raise MissionError(f"--over: {len(grid)} points; give at most {_MOST}")
    return [Job(at, _mission(options, at)) for at in grid]


def _mission(options: MissionOptions, at: dict[str, Any]) -> Mission:
    words = [f"{field}={write_value(value)}" for field, value in at.items()]
    return resolve(MissionOptions(**{**vars(options), "set": [*(options.set or []), *words]}))


def fly(
    jobs: list[Job],
    seeds: list[Seeds],
    starts: int,
    crew: Crew,
    folder: Path,
    meter: Meter,
    landed: Callable[[Point], None],
) -> None:
    """Fly every point; ``landed`` is told of each. Flights are kept in ``folder``, so that the same sweep goes on after a stop.

    Raises:
        SweepError: the folder cannot be made. rsc_swarm.study.workers.WorkerError: as rsc_swarm.study.evaluate.evaluate.
    """
    flights = folder / "flights"
    try:
        flights.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SweepError(f"--out {folder}: cannot be made ({error.strerror})") from None
    for number, job in enumerate(jobs):
        code = fingerprint(job.mission)
        said = ", ".join(f"{field}={value}" for field, value in job.at.items())
        label = f"{number + 1} of {len(jobs)}, {said}: "
        watcher = Flights(TICKS_GUESS * job.mission.ticks, meter, label, number / len(jobs), 1 / len(jobs))
        flown = evaluate(job.mission, seeds, crew, journal_path(flights / "point.json", code), watcher)
        landed(Point(at=job.at, result=summarise(job.mission, flown, starts, code)))


def rows(points: list[Point]) -> list[dict[str, Any]]:
    """The points as rows of a table. low, high: the 95 % Wilson interval of the success."""
    return [{**point.at, **_figures(point.result)} for point in points]


def _figures(result: Evaluation) -> dict[str, Any]:
    low, high = result.success_interval
    return {
        "runs": result.runs,
        "success": result.success_rate,
        "low": low,
        "high": high,
        "collision": result.collision_rate,
        "tau_s": result.tau_mean_s,
        "edge_error": result.edge_error_mean,
        "nearest_m": result.min_distance_m,
        "agreed_in_1s": result.agreed_in_1s_rate,
    }


def write(folder: Path, points: list[Point]) -> None:
    """Write the points flown so far as ``sweep.csv`` and ``sweep.json``.

    Raises:
        protocols.whole_file.WriteError: they cannot be written.
    """
    table, text = rows(points), io.StringIO()
    writer = csv.DictWriter(text, list(table[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(table)
    write_whole(folder / "sweep.csv", text.getvalue())
    write_whole(
        folder / "sweep.json", "[\n" + ",\n".join(point.model_dump_json() for point in points) + "\n]\n"
    )
