"""The plan of a flight in its room, seen from above: the fence, what stands in it, starts, and the formation at both ends."""

from pathlib import Path
from typing import Any

import numpy as np

from protocols.fleet.plan import Plan
from protocols.mission.formation import NO_PARENT
from rsc_swarm.show.plots.style import FAINT, INK, ROCK, bare, key, new_figure, number, save

_WIDTH = 9.0  # inches


def draw_plan(plan: Plan, out: Path) -> None:
    """Draw ``plan`` into the file ``out``; metres of the room, x to the east, y to the north.

    Raises:
        PlotError: matplotlib is missing, or cannot write this file.
    """
    from matplotlib.patches import Circle, Rectangle

    fence = plan.fleet.fence
    (west, east), (south, north) = fence.x_m, fence.y_m
    tall = _WIDTH * (north - south) / (east - west) + 1.2
    figure = new_figure(_WIDTH, float(np.clip(tall, 3.0, 14.0)))
    axes: Any = figure.subplots()
    bare(axes)
    axes.add_patch(Rectangle((west, south), east - west, north - south, fill=False, edgecolor=INK, lw=1.4))
    for index, (x, y, radius) in enumerate(plan.obstacles):
        axes.add_patch(
            Circle((x, y), radius + plan.limit_m, fill=False, edgecolor=ROCK, lw=0.8, ls=(0, (2, 2)))
        )
        axes.add_patch(Circle((x, y), radius, facecolor=ROCK, edgecolor="none"))
        number(axes, index, np.array((x, y)), colour="white", centred=True)
    first, last = np.array(plan.slots_at(0)), np.array(plan.slots_at(plan.ticks))
    for slot, (start, end) in enumerate(zip(first, last, strict=True)):
        axes.plot(*zip(start, end, strict=True), color=FAINT, lw=1.0, zorder=1)
        parent = int(plan.mission.layout.parent[slot])
        if parent != NO_PARENT:
            axes.plot(*zip(end, last[parent], strict=True), color=INK, lw=1.4, zorder=3)
    axes.plot(*last.T, "o", ms=8, color="white", mec=INK, mew=1.2, zorder=4)
    for drone, start in enumerate(plan.starts):
        axes.plot(*start, "o", ms=8, color=INK, mew=0, zorder=5)
        number(axes, drone, np.array(start))
    axes.plot(*plan.place.origin, "+", ms=10, color=ROCK, zorder=2)
    handles = [
        key("start", marker="o", ms=7, color=INK, lw=0, mew=0),
        key("in formation at the end", marker="o", ms=7, color=INK, mfc="white", mec=INK, lw=1.4),
        key("mission's origin", marker="+", ms=8, color=ROCK, lw=0),
        key("fence", color=INK, lw=1.4),
    ]
    axes.legend(
        handles=handles, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, frameon=False, fontsize=9
    )
    margin = 0.03 * (east - west)
    axes.set(
        xlim=(west - margin, east + margin), ylim=(south - margin, north + margin), aspect="equal",
        xlabel="x to the east, m", ylabel="y to the north, m",
    )  # fmt: skip
    save(figure, out)
