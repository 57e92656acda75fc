"""What happened on the way, as marks on the paths: swaps, drones lost, faults of the mission, a collision."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.mission.document import Mission
from rsc_swarm.show.plots.style import ALARM, INK, key, number
from world.outlets.trajectory import Trajectory

_FEW = 40  # swaps; more are drawn smaller


class _Mark(NamedTuple):
    """How one kind of event looks, and the word that explains it."""

    word: str
    marker: str
    size: float
    face: str
    edge: str


_SWAP = _Mark("swap", "D", 4.5, "white", INK)
_LOST = _Mark("lost", "X", 9.0, ALARM, "white")
_FAULTS = {
    "freeze": _Mark("hung", "s", 6.5, "#d97706", "white"),
    "restart": _Mark("restarted", "P", 9.0, "#0f9d76", "white"),
    "slow": _Mark("slowed", "v", 7.5, "#8b4fc4", "white"),
}
_Points = NDArray[np.float64]


def draw_events(axes: Any, path: Trajectory, mission: Mission, collided: bool) -> None:
    """Every event where it happened; lost drones with their numbers."""
    for mark, points in _events(path, mission):
        size, edge = (mark.size, 1.0) if mark is not _SWAP or len(points) <= _FEW else (3.0, 0.7)
        axes.plot(*points.T, mark.marker, ms=size, mfc=mark.face, mec=mark.edge, mew=edge, zorder=7)
    for tick, agent in _losses(path):
        number(axes, agent, path.positions[tick, agent], colour=_LOST.face)
    for kind, mark in _FAULTS.items():
        for tick, agent in _struck(path, mission, kind):
            number(axes, agent, path.positions[tick, agent], colour=mark.face)
    if collided:
        _draw_collision(axes, path)


def event_handles(path: Trajectory, mission: Mission) -> list[Any]:
    """Entries of the legend, for the kinds of events that happened."""
    return [
        key(mark.word, marker=mark.marker, ms=mark.size, mfc=mark.face, mec=mark.edge, lw=0)
        for mark, points in _events(path, mission)
        if len(points)
    ]


def _events(path: Trajectory, mission: Mission) -> list[tuple[_Mark, _Points]]:
    """Every kind with the (K, 2) places where it happened."""
    ticks, agents = np.nonzero(np.diff(path.slots.astype(np.int64), axis=0))
    flew = path.flying[ticks, agents]
    lost = [path.positions[tick, agent] for tick, agent in _losses(path)]
    faults = [
        (mark, np.reshape([path.positions[at] for at in _struck(path, mission, kind)], (-1, 2)))
        for kind, mark in _FAULTS.items()
    ]
    return [(_SWAP, path.positions[ticks[flew], agents[flew]]), (_LOST, np.reshape(lost, (-1, 2))), *faults]


def _losses(path: Trajectory) -> list[tuple[int, int]]:
    """(last row in the air, drone) of every loss."""
    return [(int(t), int(agent)) for t, agent in np.argwhere(path.flying[:-1] & ~path.flying[1:])]


def _struck(path: Trajectory, mission: Mission, kind: str) -> list[tuple[int, int]]:
    """(tick, drone) of every fault of this kind that came before the end."""
    holder = {int(slot): agent for agent, slot in enumerate(path.slots[0])}
    return [
        (fault.at_tick, agent)
        for fault in mission.faults
        if fault.kind == kind and fault.at_tick < len(path.positions)
        for agent in (*fault.agents, *(holder[slot] for slot in fault.slots))
    ]


def _draw_collision(axes: Any, path: Trajectory) -> None:
    x, y = collision_place(path)
    axes.plot(x, y, "o", ms=22, mfc="none", mec=ALARM, mew=2.2, zorder=9)
    axes.annotate(
        "collision", (x, y), (14, 14), textcoords="offset points", color=ALARM, fontsize=11, weight="bold", zorder=9
    )  # fmt: skip


def collision_place(path: Trajectory) -> tuple[float, float]:
    """Where the closest pair is at the last moment, m."""
    flying = path.positions[-1, path.flying[-1]]
    gaps = np.linalg.norm(flying[:, None] - flying[None], axis=2)
    np.fill_diagonal(gaps, np.inf)
    first, second = np.unravel_index(gaps.argmin(), gaps.shape)
    x, y = (flying[first] + flying[second]) / 2
    if len(path.obstacles):
        discs = path.obstacles
        surface = np.linalg.norm(flying[:, None] - discs[None, :, :2], axis=2) - discs[None, :, 2]
        if surface.min() < gaps.min():
            x, y = flying[np.unravel_index(surface.argmin(), surface.shape)[0]]
    return float(x), float(y)
