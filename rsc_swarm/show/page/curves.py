"""Four curves of a flight over time: edge error, slot error, nearest distance, speed; as the template draws them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rsc_swarm.flight.events import BEFALLING
from rsc_swarm.flight.recorded import Recorded
from rsc_swarm.show.page.scale import points, ticks
from world.outlets.judged import findings_of

WIDTH, HEIGHT = 520.0, 190.0  # px
LEFT, RIGHT, TOP, BOTTOM = 44.0, 12.0, 12.0, 24.0
_MOST_POINTS = 500
_MARKED = (*BEFALLING, "collision", "success")


@dataclass(frozen=True)
class Tick:
    """A number on an axis, and where, px."""

    text: str
    at: float


@dataclass(frozen=True)
class Curve:
    """One panel. lines: (class, points, what). limit: y of a dashed line. bands: (x, width) while the radio was parted. marks:
    (x, kind, text)."""

    title: str
    note: str
    lines: tuple[tuple[str, str, str], ...]
    limit: float | None
    x_ticks: tuple[Tick, ...]
    y_ticks: tuple[Tick, ...]
    bands: tuple[tuple[float, float], ...]
    marks: tuple[tuple[float, str, str], ...]


class _Line(NamedTuple):
    """One line over all rows: style, values (T,) with nan for nothing, what it is, whether the least values matter most."""

    style: str
    values: NDArray[np.float64]
    what: str
    least: bool = False


def curves(recorded: Recorded) -> list[Curve]:
    """The curves of a flight; of one drone alone, and of an empty field, only those that there are."""
    path, mission = recorded.path, recorded.mission
    verdict, flying = findings_of(path, mission).verdict, path.flying
    anyone: NDArray[np.bool_] = flying.max(axis=1)
    several = mission.agents > 1
    near = np.minimum(verdict["closest_agents_m"], verdict["closest_obstacle_m"])
    speed = np.where(flying, np.linalg.norm(path.velocities, axis=2), 0.0)
    mean = speed.sum(axis=1) / np.maximum(flying.sum(axis=1), 1)
    tolerance, collision_m = 100 * mission.edge_tolerance, mission.limits.collision_m
    edge = _Line("main", _where(anyone, 100 * verdict["edge_error"]), "worst edge error")
    slot = _Line("main", _where(anyone, verdict["slot_error_m"]), "worst slot error")
    nearest = _Line("main", _where(np.isfinite(near), near), "nearest distance", least=True)
    fastest = _Line("main", _where(anyone, speed.max(axis=1)), "fastest drone")
    average = _Line("second", _where(anyone, mean), "mean of all")
    own = mission.target.speed_mps
    made = [
        several and _curve(
            recorded, "Worst edge error, %", f"edges off their length; in formation below {tolerance:g} % (dashed)",
            [edge], tolerance,
        ),
        _curve(recorded, "Slot error, m", f"from the {'farthest ' if several else ''}drone to its place", [slot], None),
        np.isfinite(near).any() and _curve(
            recorded, "Nearest distance, m",
            f"between drones, and to obstacles; a collision below {collision_m:g} m (dashed)", [nearest], collision_m,
        ),
        _curve(
            recorded, "Speed, m/s", f"{'fastest, mean in grey; ' if several else ''}the formation flies at {own:g} m/s (dashed)",
            [fastest, average] if several else [fastest], own,
        ),
    ]  # fmt: skip
    return [curve for curve in made if isinstance(curve, Curve)]


def _where(known: NDArray[np.bool_], values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(known, values, np.nan)


def _curve(recorded: Recorded, title: str, note: str, lines: Sequence[_Line], limit: float | None) -> Curve:
    path = recorded.path
    end_s = max((len(path.slots) - 1) * path.tick_s, path.tick_s)
    tops = [float(np.nanmax(line.values)) for line in lines if not np.isnan(line.values).all()]
    top = max([*tops, 1.15 * (limit or 0.0), 1e-3]) * 1.04

    def x_of(time_s: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * time_s / end_s

    def y_of(value: float) -> float:
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * value / top

    drawn = []
    for line in lines:
        times, kept = _thinned(line, path.tick_s)
        drawn += [
            (line.style, points([x_of(t) for t in times[piece]], [y_of(v) for v in kept[piece]]), line.what)
            for piece in _pieces(kept)
        ]
    marks = tuple(
        (x_of(event.time_s), event.what, f"{event.time_s:.2f} s: {event.text}")
        for event in recorded.events
        if event.what in _MARKED
    )
    return Curve(
        title, note, tuple(drawn), None if limit is None else y_of(limit),
        tuple(Tick(f"{value:g}", x_of(value)) for value in ticks(0.0, end_s, 8)),
        tuple(Tick(f"{value:g}", y_of(value)) for value in ticks(0.0, top, 4)),
        tuple((x_of(begin), x_of(until) - x_of(begin)) for begin, until in _parted(recorded, end_s)), marks,
    )  # fmt: skip


def _thinned(line: _Line, tick_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times and values, no more than can be seen: of each stretch what matters most."""
    step = max(1, math.ceil(len(line.values) / _MOST_POINTS))
    starts = np.arange(0, len(line.values), step)
    kept = (np.fmin if line.least else np.fmax).reduceat(line.values, starts)
    return np.asarray(starts * tick_s, np.float64), np.asarray(kept, np.float64)


def _pieces(values: NDArray[np.float64]) -> list[slice]:
    """Stretches without gaps."""
    known = np.flatnonzero(np.diff(np.concatenate([[0], (~np.isnan(values)).astype(np.int8), [0]])))
    return [slice(int(begin), int(end)) for begin, end in known.reshape(-1, 2)]


def _parted(recorded: Recorded, end_s: float) -> list[tuple[float, float]]:
    """Times during which the radio was parted, s."""
    found: list[tuple[float, float]] = []
    begun: float | None = None
    for event in recorded.events:
        if event.what == "part" and begun is None:
            begun = event.time_s
        elif event.what == "heal" and begun is not None:
            found.append((begun, event.time_s))
            begun = None
    return [*found, (begun, end_s)] if begun is not None else found
