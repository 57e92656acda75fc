"""The picture of a flight, seen from above: the drones' paths, the obstacles, the formation reached."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from protocols.mission.document import Mission
from protocols.mission.formation import NO_PARENT, Formation
from rsc_swarm.show.plots.style import ALARM, FAINT, INK, ROCK, PlotError, bare, new_figure, save

_WIDTH = 11.0  # inches
_COLOURS = "turbo"
_SMOOTH_TICKS = 4  # a path needs no more points than this


@dataclass(frozen=True)
class Track:
    """A recorded flight (world.outlets.recorder). verdict: one line; tau_s: None without success."""

    positions: NDArray[np.float64]
    slots: NDArray[np.int16]
    flying: NDArray[np.bool_]
    obstacles: NDArray[np.float64]
    goal_x: float
    tick_s: float
    tau_s: float | None
    failure: str | None
    verdict: str


def load_track(path: Path, tau_s: float | None, failure: str | None, verdict: str) -> Track:
    """The flight recorded in ``path``.

    Raises:
        PlotError: no such file, or it is not a recorded flight.
    """
    try:
        with np.load(path) as saved:
            return Track(
                saved["positions"], saved["slots"], saved["flying"], saved["obstacles"],
                float(saved["goal_x"]), float(saved["tick_s"]), tau_s, failure, verdict,
            )  # fmt: skip
    except (OSError, KeyError, ValueError) as error:
        raise PlotError(f"{path}: is not a recorded flight ({' '.join(str(error).split())})") from None


def draw(flights: Sequence[tuple[Track, Mission]], out: Path) -> None:
    """Draw ``flights``, one below the other and to the same scale, into the file ``out``.

    Raises:
        PlotError: matplotlib is missing, or cannot write this file.
    """
    frames = [_frame(track) for track, _ in flights]
    left, right = min(low[0] for low, _ in frames), max(high[0] for _, high in frames)
    heights = [float(high[1] - low[1]) for low, high in frames]
    across = _WIDTH / (right - left)
    tall = sum(heights) * across + 0.4 + 0.6 * len(flights)
    figure = new_figure(_WIDTH, float(np.clip(tall, 3.2, 11.0 * len(flights))))
    panels = figure.subplots(len(flights), squeeze=False, height_ratios=heights)[:, 0]
    for axes, (track, mission), (low, high) in zip(panels, flights, frames, strict=True):
        _draw_flight(axes, track, mission)
        axes.set(xlim=(left, right), ylim=(low[1], high[1]), aspect="equal", ylabel="y, m")
    panels[-1].set_xlabel("x, m")
    save(figure, out)


def _draw_flight(axes: Any, track: Track, mission: Mission) -> None:
    bare(axes)
    _draw_field(axes, track, mission)
    _draw_midway(axes, track, mission.plan)
    _draw_paths(axes, track, mission)
    _draw_formation(axes, track, mission.plan)
    _draw_events(axes, track, mission)
    axes.set_title(track.verdict, loc="left", fontsize=12, color=ALARM if track.failure else INK, pad=10)
    _draw_legend(axes, track)


def _frame(track: Track) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower left and upper right corner of what must be seen."""
    points = [track.positions.reshape(-1, 2)]
    for disc in track.obstacles:
        points += [disc[None, :2] - disc[2], disc[None, :2] + disc[2]]
    everything = np.concatenate(points)
    return everything.min(axis=0) - 2.5, everything.max(axis=0) + 2.5


def _colours(track: Track) -> NDArray[np.float64]:
    """(N, 4) one colour per drone, in the order of their starts from right to left."""
    from matplotlib import colormaps

    rank = np.argsort(np.argsort(track.positions[0, :, 1], kind="stable"))
    return np.asarray(colormaps[_COLOURS](0.06 + 0.88 * rank / max(1, len(rank) - 1)))


def _draw_field(axes: Any, track: Track, mission: Mission) -> None:
    from matplotlib.patches import Circle

    for x, y, radius in track.obstacles:
        keep_off = radius + mission.limits.collision_m
        axes.add_patch(
            Circle((x, y), keep_off, facecolor="none", edgecolor=ROCK, lw=0.8, ls=(0, (2, 2)), zorder=2)
        )
        axes.add_patch(Circle((x, y), radius, facecolor=ROCK, edgecolor="none", zorder=2))
    axes.axvline(track.goal_x, color=INK, lw=1.2, ls=(0, (6, 4)), zorder=1)


def _edges(track: Track, plan: Formation, tick: int) -> list[NDArray[np.float64]]:
    """Tree edges at ``tick`` as (2, 2) pairs of points, between the drones that claim the slots and fly."""
    holder = {int(slot): agent for agent, slot in enumerate(track.slots[tick]) if track.flying[tick, agent]}
    return [
        track.positions[tick, [holder[int(parent)], holder[slot]]]
        for slot, parent in enumerate(plan.parent)
        if parent != NO_PARENT and slot in holder and int(parent) in holder
    ]


def _draw_midway(axes: Any, track: Track, plan: Formation) -> None:
    """The swarm half-way, and when each of the three moments shown was."""
    from matplotlib.collections import LineCollection

    end = _last_tick(track)
    axes.add_collection(
        LineCollection(_edges(track, plan, end // 2), colors=ROCK, lw=1.0, alpha=0.75, zorder=5)
    )
    for agent, colour in enumerate(_colours(track)):
        if track.flying[end // 2, agent]:
            axes.plot(
                *track.positions[end // 2, agent], "o", ms=5, color=colour, mec="white", mew=0.7, zorder=6
            )
    for tick in (0, end // 2, end):
        flying = track.positions[tick, track.flying[tick]]
        if len(flying):
            axes.annotate(
                f"{tick * track.tick_s:.1f} s", (float(flying[:, 0].mean()), 1.0), (0, -4),
                xycoords=("data", "axes fraction"), textcoords="offset points", ha="center", va="top",
                color=ROCK, fontsize=10,
            )  # fmt: skip


def _last_tick(track: Track) -> int:
    """The tick of success, else the end."""
    last = len(track.positions) - 1
    return last if track.tau_s is None else min(last, round(track.tau_s / track.tick_s))


def _draw_paths(axes: Any, track: Track, mission: Mission) -> None:
    from matplotlib.collections import LineCollection

    width = 1.6 if mission.agents <= 36 else 1.0
    for agent, colour in enumerate(_colours(track)):
        path = track.positions[track.flying[:, agent], agent][::_SMOOTH_TICKS]
        pieces = np.stack([path[:-1], path[1:]], axis=1)
        shades = np.tile(colour, (len(pieces), 1))
        shades[:, 3] = np.linspace(0.25, 0.95, len(pieces))
        axes.add_collection(LineCollection(list(pieces), colors=shades, lw=width, capstyle="butt", zorder=4))
        axes.plot(*track.positions[0, agent], "o", ms=3.2, color=colour, alpha=0.6, mew=0, zorder=4)


def _draw_formation(axes: Any, track: Track, plan: Formation) -> None:
    """The moment of success, or the end: every drone, and the tree that joins them."""
    from matplotlib.collections import LineCollection

    tick = _last_tick(track)
    axes.add_collection(LineCollection(_edges(track, plan, tick), colors=INK, lw=1.4, zorder=5))
    for agent, colour in enumerate(_colours(track)):
        if track.flying[tick, agent]:
            axes.plot(*track.positions[tick, agent], "o", ms=7, color=colour, mec=INK, mew=1.0, zorder=6)


def _draw_events(axes: Any, track: Track, mission: Mission) -> None:
    """Swaps, losses, and the collision if there was one."""
    ticks, agents = np.nonzero(np.diff(track.slots.astype(np.int64), axis=0))
    flew = track.flying[ticks, agents]
    swapped = track.positions[ticks[flew], agents[flew]]
    size, edge = (4.5, 1.0) if len(swapped) <= 40 else (3.0, 0.7)
    axes.plot(*swapped.T, "D", ms=size, mfc="white", mec=INK, mew=edge, zorder=7)
    for agent in np.flatnonzero(~track.flying[-1] & track.flying[0]):
        last = int(np.flatnonzero(track.flying[:, agent])[-1])
        axes.plot(*track.positions[last, agent], "X", ms=9, color=ALARM, mec="white", mew=0.8, zorder=8)
    if track.failure == "collision":
        x, y = _collision(track)
        axes.plot(x, y, "o", ms=22, mfc="none", mec=ALARM, mew=2.2, zorder=9)
        axes.annotate(
            "collision",
            (x, y),
            (14, 14),
            textcoords="offset points",
            color=ALARM,
            fontsize=11,
            weight="bold",
            zorder=9,
        )


def _collision(track: Track) -> tuple[float, float]:
    """Where the closest pair is at the last moment."""
    flying = track.positions[-1, track.flying[-1]]
    gaps = np.linalg.norm(flying[:, None] - flying[None], axis=2)
    np.fill_diagonal(gaps, np.inf)
    first, second = np.unravel_index(gaps.argmin(), gaps.shape)
    x, y = (flying[first] + flying[second]) / 2
    if len(track.obstacles):
        surface = (
            np.linalg.norm(flying[:, None] - track.obstacles[None, :, :2], axis=2)
            - track.obstacles[None, :, 2]
        )
        if surface.min() < gaps.min():
            x, y = flying[np.unravel_index(surface.argmin(), surface.shape)[0]]
    return float(x), float(y)


def _draw_legend(axes: Any, track: Track) -> None:
    """Explain what is there, and only that."""
    from matplotlib.lines import Line2D

    def mark(label: str, **style: Any) -> Line2D:
        return Line2D([], [], label=label, **style)

    end = "in formation" if track.failure is None else "at the end"
    handles = [
        mark("start", marker="o", ms=4, color=FAINT, lw=0, mew=0),
        mark(end, marker="o", ms=7, color=INK, mfc="white", mec=INK, lw=1.4),
    ]
    if np.diff(track.slots.astype(np.int64), axis=0).any():
        handles.append(mark("swap", marker="D", ms=4.5, mfc="white", mec=INK, lw=0))
    if not track.flying.all():
        handles.append(mark("lost", marker="X", ms=8, color=ALARM, mec="white", lw=0))
    if len(track.obstacles):
        handles.append(mark("obstacle", marker="o", ms=8, color=ROCK, lw=0))
    handles.append(mark("goal", color=INK, lw=1.2, ls=(0, (4, 3))))
    axes.legend(
        handles=handles, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(handles), frameon=False,
        fontsize=9, labelcolor=ROCK, handletextpad=0.5, columnspacing=1.4, borderaxespad=0.3,
    )  # fmt: skip
