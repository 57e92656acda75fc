"""The picture of a flight, seen from above: the drones' paths, the obstacles, the formation reached.

Drones and obstacles carry the numbers by which reports speak of them.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from protocols.mission.formation import NO_PARENT, Formation
from rsc_swarm.flight.recorded import Recorded
from rsc_swarm.show.plots.events import draw_events, event_handles
from rsc_swarm.show.plots.style import ALARM, FAINT, INK, ROCK, bare, halo, key, new_figure, number, save
from world.outlets.trajectory import Trajectory

_WIDTH = 11.0  # inches
_COLOURS = "turbo"
_SMOOTH_TICKS = 4  # a path needs no more points than this
_SMALLEST_M = 12.0  # a swarm that hardly moves is not drawn larger than life
_APART_M = 2.0  # what is nearer than this would be written over


def draw(tracks: Sequence[Recorded], out: Path) -> None:
    """Draw flights, one below the other and to the same scale, into the file ``out``.

    Raises:
        PlotError: matplotlib is missing, or cannot write this file.
    """
    frames = [bounds(track) for track in tracks]
    left, right = min(low[0] for low, _ in frames), max(high[0] for _, high in frames)
    heights = [float(high[1] - low[1]) for low, high in frames]
    across = _WIDTH / (right - left)
    tall = sum(heights) * across + 0.4 + 0.6 * len(tracks)
    figure = new_figure(_WIDTH, float(np.clip(tall, 3.2, 11.0 * len(tracks))))
    panels = figure.subplots(len(tracks), squeeze=False, height_ratios=heights)[:, 0]
    for axes, track, (low, high) in zip(panels, tracks, frames, strict=True):
        _draw_flight(axes, track)
        axes.set(xlim=(left, right), ylim=(low[1], high[1]), aspect="equal", ylabel="y, m")
    panels[-1].set_xlabel("x, m")
    save(figure, out)


def _draw_flight(axes: Any, track: Recorded) -> None:
    bare(axes)
    draw_field(axes, track)
    _draw_midway(axes, track)
    _draw_paths(axes, track.path, track.final_row)
    _draw_formation(axes, track)
    draw_events(axes, track)
    axes.set_title(track.verdict, loc="left", fontsize=12, color=ALARM if track.failure else INK, pad=10)
    _draw_legend(axes, track)


def bounds(track: Recorded) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower left and upper right corner of the picture, m."""
    low, high = track.frame
    margin = np.maximum(2.5, (_SMALLEST_M - (high - low)) / 2)
    return low - margin, high + margin


def colours(path: Trajectory) -> NDArray[np.float64]:
    """(N, 4) one colour per drone, in the order of their starts from right to left."""
    from matplotlib import colormaps

    rank = np.argsort(np.argsort(path.positions[0, :, 1], kind="stable"))
    return np.asarray(colormaps[_COLOURS](0.06 + 0.88 * rank / max(1, len(rank) - 1)))


def draw_field(axes: Any, track: Recorded) -> None:
    from matplotlib.patches import Circle

    for index, (x, y, radius) in enumerate(track.path.obstacles):
        keep_off = radius + track.mission.limits.collision_m
        axes.add_patch(
            Circle((x, y), keep_off, facecolor="none", edgecolor=ROCK, lw=0.8, ls=(0, (2, 2)), zorder=2)
        )
        axes.add_patch(Circle((x, y), radius, facecolor=ROCK, edgecolor="none", zorder=2))
        number(axes, index, free_place(track.path.obstacles, index), colour="white", centred=True)
    if track.goal_in_sight:
        axes.axvline(track.path.goal_x, color=INK, lw=1.2, ls=(0, (6, 4)), zorder=1)


def free_place(discs: NDArray[np.float64], index: int) -> NDArray[np.float64]:
    """In the disc of this index, away from the middles of others that overlap it: for its number, m."""
    middle, radius = discs[index, :2], discs[index, 2]
    away = middle - np.delete(discs[:, :2], index, axis=0)
    away = away[np.linalg.norm(away, axis=1) < _APART_M].sum(axis=0)
    length = float(np.linalg.norm(away))
    return np.asarray(middle + 0.6 * radius * away / length if length > 0 else middle)


def edges(path: Trajectory, layout: Formation, tick: int) -> list[NDArray[np.float64]]:
    """Tree edges at ``tick`` as (2, 2) pairs of points, between the drones that claim the slots and fly."""
    holder = {int(slot): agent for agent, slot in enumerate(path.slots[tick]) if path.flying[tick, agent]}
    return [
        path.positions[tick, [holder[int(parent)], holder[slot]]]
        for slot, parent in enumerate(layout.parent)
        if parent != NO_PARENT and slot in holder and int(parent) in holder
    ]


def _draw_midway(axes: Any, track: Recorded) -> None:
    """The swarm half-way, and when each of the three moments shown was; of a flight too short for that only its end."""
    from matplotlib.collections import LineCollection

    path, middle = track.path, track.final_row // 2
    _write_time(axes, path, track.final_row)
    if np.linalg.norm(np.ptp(path.positions[[0, track.final_row]].mean(axis=1), axis=0)) < _SMALLEST_M:
        return
    lines = edges(path, track.mission.layout, middle)
    axes.add_collection(LineCollection(lines, colors=ROCK, lw=1.0, alpha=0.75, zorder=5))
    for agent, colour in enumerate(colours(path)):
        if path.flying[middle, agent]:
            axes.plot(*path.positions[middle, agent], "o", ms=5, color=colour, mec="white", mew=0.7, zorder=6)
    for tick in (0, middle):
        _write_time(axes, path, tick)


def _write_time(axes: Any, path: Trajectory, tick: int) -> None:
    """Above the swarm as it was at ``tick``."""
    flying = path.positions[tick, path.flying[tick]]
    if len(flying):
        middle = float(flying[:, 0].mean())
        at_goal = abs(middle - path.goal_x) < _APART_M  # beside the line then, not on it
        axes.annotate(
            f"{tick * path.tick_s:.{2 if 0 < tick * path.tick_s < 0.1 else 1}f} s",
            (path.goal_x if at_goal else middle, 1.0), (-6 if at_goal else 0, -4), xycoords=("data", "axes fraction"),
            textcoords="offset points", ha="right" if at_goal else "center", va="top", color=ROCK, fontsize=10,
            path_effects=halo("white", 4),
        )  # fmt: skip


def _draw_paths(axes: Any, path: Trajectory, end: int) -> None:
    """Every drone's way, with its number at the start where that is not written at the end already."""
    from matplotlib.collections import LineCollection

    agents = path.flying.shape[1]
    width = 1.6 if agents <= 36 else 1.0
    for agent, colour in enumerate(colours(path)):
        way = path.positions[path.flying[:, agent], agent][::_SMOOTH_TICKS]
        pieces = np.stack([way[:-1], way[1:]], axis=1)
        shades = np.tile(colour, (len(pieces), 1))
        shades[:, 3] = np.linspace(0.25, 0.95, len(pieces))
        axes.add_collection(LineCollection(list(pieces), colors=shades, lw=width, capstyle="butt", zorder=4))
        axes.plot(*path.positions[0, agent], "o", ms=3.2, color=colour, alpha=0.6, mew=0, zorder=4)
        if np.linalg.norm(path.positions[end, agent] - path.positions[0, agent]) > _APART_M:
            number(axes, agent, path.positions[0, agent], colour=ROCK)


def _draw_formation(axes: Any, track: Recorded) -> None:
    """The moment of success, or the end: every drone with its number, and the tree that joins them."""
    from matplotlib.collections import LineCollection

    path, tick = track.path, track.final_row
    lines = edges(path, track.mission.layout, tick)
    axes.add_collection(LineCollection(lines, colors=INK, lw=1.4, zorder=5))
    for agent, colour in enumerate(colours(path)):
        if path.flying[tick, agent]:
            axes.plot(*path.positions[tick, agent], "o", ms=7, color=colour, mec=INK, mew=1.0, zorder=6)
            number(axes, agent, path.positions[tick, agent])


def _draw_legend(axes: Any, track: Recorded) -> None:
    """Explain what is there, and only that."""
    end = "at the end" if track.failure or track.mission.agents == 1 else "in formation"
    handles = [
        key("start", marker="o", ms=4, color=FAINT, lw=0, mew=0),
        key(
            end, marker="o", ms=7, color=INK, mfc="white", mec=INK, lw=1.4 if track.mission.agents > 1 else 0
        ),
        *event_handles(track),
    ]
    if len(track.path.obstacles):
        handles.append(key("obstacle", marker="o", ms=8, color=ROCK, lw=0))
    if track.goal_in_sight:
        handles.append(key("goal", color=INK, lw=1.2, ls=(0, (4, 3))))
    axes.legend(
        handles=handles, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(handles), frameon=False,
        fontsize=9, labelcolor=ROCK, handletextpad=0.5, columnspacing=1.4, borderaxespad=0.3,
    )  # fmt: skip
