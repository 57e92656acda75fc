"""The map of a flight, as the template draws it: metres of the mission become pixels, x to the right and y up."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from protocols.mission.formation import NO_PARENT
from rsc_swarm.flight.events import BEFALLING
from rsc_swarm.flight.recorded import Recorded
from rsc_swarm.show.page.scale import points, ticks
from rsc_swarm.show.plots.flight import free_place

_WIDTH = 1056.0  # px; a long field gets more, and can be scrolled
_LEAST_PX_PER_M, _MOST_PX_PER_M, _MOST_WIDTH = 7.0, 40.0, 8000.0
_MARGIN_M = 3.0
_LEFT, _TOP, _BOTTOM = 34.0, 26.0, 30.0
_MOST_POINTS = 40_000  # of all paths together
_MOMENTS = 4  # at which the formation is drawn
_APART_M = 2.0
_MARKED = (*BEFALLING, "swap", "takeover", "move", "detour", "closest", "collision")


@dataclass(frozen=True)
class Drone:
    """A drone's path: hue of its colour, points, start, and where it is at the end (None: out of the air)."""

    number: int
    hue: int
    line: str
    start: tuple[float, float]
    end: tuple[float, float] | None
    far: bool


@dataclass(frozen=True)
class Disc:
    """An obstacle, how near a drone may come to it, and where its number is written, px."""

    number: int
    x: float
    y: float
    radius: float
    keep_off: float
    label: tuple[float, float]


@dataclass(frozen=True)
class Moment:
    """The formation at one time: its edges (x1, y1, x2, y2) and drones (x, y, hue), and a place for the time above it."""

    text: str
    x: float
    edges: tuple[tuple[float, float, float, float], ...]
    drones: tuple[tuple[float, float, int], ...]


@dataclass(frozen=True)
class Mark:
    """An event where it happened; event: its place among all; number: of the drone, where it alone is meant."""

    event: int
    what: str
    x: float
    y: float
    text: str
    number: int | None


@dataclass(frozen=True)
class Drawing:
    """All of the map."""

    width: float
    height: float
    drones: tuple[Drone, ...]
    discs: tuple[Disc, ...]
    goal: float | None
    moments: tuple[Moment, ...]
    final: Moment
    marks: tuple[Mark, ...]
    x_ticks: tuple[tuple[str, float], ...]
    y_ticks: tuple[tuple[str, float], ...]
    top: float
    bottom: float
    left: float


class _Paper:
    """From metres to pixels."""

    def __init__(self, recorded: Recorded) -> None:
        low, high = recorded.frame
        self.low, self.high = low - _MARGIN_M, high + _MARGIN_M
        across = float(self.high[0] - self.low[0])
        self.scale = min(max((_WIDTH - _LEFT) / across, _LEAST_PX_PER_M), _MOST_PX_PER_M)
        self.scale = min(self.scale, max(_MOST_WIDTH / across, (_WIDTH - _LEFT) / across))
        self.width = _LEFT + across * self.scale
        self.height = _TOP + float(self.high[1] - self.low[1]) * self.scale + _BOTTOM

    def x(self, metres: float) -> float:
        return round(_LEFT + (float(metres) - float(self.low[0])) * self.scale, 1)

    def y(self, metres: float) -> float:
        return round(_TOP + (float(self.high[1]) - float(metres)) * self.scale, 1)

    def at(self, place: NDArray[np.float64] | tuple[float, float]) -> tuple[float, float]:
        return self.x(place[0]), self.y(place[1])


def drawing(recorded: Recorded) -> Drawing:
    """The map of a flight."""
    paper, path = _Paper(recorded), recorded.path
    hues = _hues(path.positions[0, :, 1])
    end = recorded.final_row
    keep_off = recorded.mission.limits.collision_m
    return Drawing(
        round(paper.width), round(paper.height),
        tuple(_drone(recorded, paper, agent, hue, end) for agent, hue in enumerate(hues)),
        tuple(
            Disc(number, *paper.at((x, y)), radius * paper.scale, (radius + keep_off) * paper.scale,
                 paper.at(free_place(path.obstacles, number)))
            for number, (x, y, radius) in enumerate(path.obstacles.tolist())
        ),
        paper.x(path.goal_x) if recorded.goal_in_sight else None,
        tuple(_moment(recorded, paper, hues, tick) for tick in _between(recorded, end)),
        _moment(recorded, paper, hues, end), _marks(recorded, paper),
        tuple((f"{value:g}", paper.x(value)) for value in ticks(paper.low[0], paper.high[0], int(paper.width / 90))),
        tuple((f"{value:g}", paper.y(value)) for value in ticks(paper.low[1], paper.high[1], max(2, int(paper.height / 60)))),
        _TOP, paper.height - _BOTTOM, _LEFT,
    )  # fmt: skip


def _hues(start_y: NDArray[np.float64]) -> list[int]:
    """A colour for each drone, from blue at the right wing to red at the left one."""
    rank = np.argsort(np.argsort(start_y, kind="stable"))
    return [round(235 - 235 * number / max(1, len(rank) - 1)) for number in rank.tolist()]


def _drone(recorded: Recorded, paper: _Paper, agent: int, hue: int, end: int) -> Drone:
    path = recorded.path
    step = max(4, -(-path.slots.size // _MOST_POINTS))
    rows = np.flatnonzero(path.flying[:, agent])
    kept = np.unique(np.concatenate([rows[::step], rows[-1:]]))
    way = path.positions[kept, agent]
    line = points([paper.x(x) for x in way[:, 0]], [paper.y(y) for y in way[:, 1]])
    first, last = path.positions[0, agent], path.positions[end, agent]
    return Drone(
        agent, hue, line, paper.at(first), paper.at(last) if path.flying[end, agent] else None,
        bool(np.linalg.norm(last - first) > _APART_M),
    )  # fmt: skip


def _between(recorded: Recorded, end: int) -> list[int]:
    """Rows between the start and ``end`` at which the formation is drawn, where it has moved on by then."""
    moved = float(np.linalg.norm(np.ptp(recorded.path.positions[: end + 1].mean(axis=1), axis=0)))
    breadth = float(np.linalg.norm(np.ptp(recorded.path.positions[0], axis=0)))
    moments = int(min(_MOMENTS - 1, moved / max(0.8 * breadth, 8.0)))
    return [round(end * number / (moments + 1)) for number in range(moments + 1)]


def _moment(recorded: Recorded, paper: _Paper, hues: list[int], tick: int) -> Moment:
    path, parent = recorded.path, recorded.mission.layout.parent
    flying = np.flatnonzero(path.flying[tick]).tolist()
    holder = {int(path.slots[tick, agent]): agent for agent in flying}
    edges = tuple(
        (*paper.at(path.positions[tick, agent]), *paper.at(path.positions[tick, holder[int(parent[slot])]]))
        for slot, agent in holder.items()
        if parent[slot] != NO_PARENT and int(parent[slot]) in holder
    )
    drones = tuple((*paper.at(path.positions[tick, agent]), hues[agent]) for agent in flying)
    middle = float(path.positions[tick, flying, 0].mean()) if flying else float(paper.low[0])
    return Moment(f"{tick * path.tick_s:.3g} s", paper.x(middle), edges, drones)


def _marks(recorded: Recorded, paper: _Paper) -> tuple[Mark, ...]:
    marks: list[Mark] = []
    for place, event in enumerate(recorded.events):
        if event.place_m is not None and event.what in _MARKED:
            number = event.agents[0] if event.what in BEFALLING else None
            text = f"{event.time_s:.2f} s: {event.text}"
            places = [event.place_m]
            if event.slots:  # on the paths of both
                places = recorded.path.positions[event.tick, list(event.agents)].tolist()
            marks += [Mark(place, event.what, *paper.at(at), text, number) for at in places]
    return tuple(marks)
