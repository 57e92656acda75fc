"""The plan of a flight in its room, seen from above: the fence, what stands in it, starts, and the formation at both ends."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from protocols.dynamics import TICK_S
from protocols.fleet.plan import Plan
from protocols.mission.formation import NO_PARENT
from rsc_swarm.show.plots.style import FAINT, INK, ROCK, bare, key, new_figure, number, save

_WIDTH, _AROUND = 9.0, 1.9  # inches; what is above and below the room
_DASHED, _DOTTED = (0, (6, 3)), (0, (2, 2))


def draw_plan(plan: Plan, out: Path) -> None:
    """Draw ``plan`` into the file ``out``; metres of the room, x to the east, y to the north.

    Raises:
        PlotError: matplotlib is missing, or cannot write this file.
    """
    fence = plan.fleet.fence
    (west, east), (south, north) = fence.x_m, fence.y_m
    tall = _WIDTH * (north - south) / (east - west) + _AROUND
    figure = new_figure(_WIDTH, float(np.clip(tall, 4.0, 14.0)))
    figure.set_layout_engine("constrained")
    axes: Any = figure.subplots()
    bare(axes)
    margin = 0.03 * (east - west)
    axes.set(
        xlim=(west - margin, east + margin), ylim=(south - margin, north + margin), aspect="equal",
        xlabel="x to the east, m", ylabel="y to the north, m",
    )  # fmt: skip
    _draw_room(axes, plan)
    _draw_flight(axes, plan)
    axes.set_title(told(plan), loc="left", fontsize=9, color=INK, pad=10)
    handles = [
        key("a drone stands here", marker="o", ms=7, color=INK, lw=0, mew=0),
        key("its way, but for detours", color=FAINT, lw=1.0),
        key("in formation it lands here", marker="o", ms=7, color=INK, mfc="white", mec=INK, lw=1.4),
        key("fence", color=INK, lw=2.2),
        key("goal line", color=ROCK, lw=1.0, ls=_DASHED),
        key("mission's origin", marker="+", ms=8, color=ROCK, lw=0),
    ]
    if plan.obstacles:
        handles.append(key("obstacle, by its number", marker="o", ms=9, color=ROCK, lw=0, mew=0))
    if plan.virtual_obstacles:
        handles.append(key("one that only the world knows", marker="o", ms=9, color=FAINT, lw=0, mew=0))
    if plan.obstacles or plan.virtual_obstacles:
        handles.append(key("nearer is a collision", color=ROCK, lw=0.8, ls=_DOTTED))
    figure.legend(handles=handles, loc="outside lower left", ncols=3, frameon=False, fontsize=9)
    save(figure, out)


def told(plan: Plan) -> str:
    """What the picture cannot show, in two lines."""
    fleet, heights = plan.fleet, sorted({plan.height(slot) for slot in range(plan.mission.agents)})
    high = f"{heights[0]:g} m" if len(heights) == 1 else f"{heights[0]:g} to {heights[-1]:g} m"
    turned = f", turned by {fleet.yaw_deg:g} degrees" if fleet.yaw_deg else ""
    low, ceiling = fleet.fence.z_m
    return (
        f"{plan.drones_told}, mission {fleet.mission}, 1 m of it is {fleet.scale:g} m here{turned}; "
        f"{plan.ticks * TICK_S:g} s long\n"
        f"{high} high (fence {low:g} to {ceiling:g} m), at most {plan.speed_mps:.2f} m/s; "
        f"nearer than {plan.limit_m:.2f} m to each other is a collision"
    )


def _draw_room(axes: Any, plan: Plan) -> None:
    from matplotlib.patches import Circle, Rectangle

    (west, east), (south, north) = plan.fleet.fence.x_m, plan.fleet.fence.y_m
    inside = Rectangle((west, south), east - west, north - south, fill=False, edgecolor=INK, lw=2.2)
    axes.add_patch(inside)
    discs = [(disc, ROCK) for disc in plan.obstacles] + [(disc, FAINT) for disc in plan.virtual_obstacles]
    for index, ((x, y, radius), colour) in enumerate(discs):
        axes.add_patch(Circle((x, y), radius + plan.limit_m, fill=False, edgecolor=ROCK, lw=0.8, ls=_DOTTED))
        axes.add_patch(Circle((x, y), radius, facecolor=colour, edgecolor="none"))
        number(axes, index, np.array((x, y)), colour="white", centred=True)
    reach = 2 * math.hypot(east - west, north - south) / plan.fleet.scale  # to the fence, from wherever
    goal = [plan.place.to_room((plan.goal_x_m, y)) for y in (-reach, reach)]
    (line,) = axes.plot(*np.array(goal).T, color=ROCK, lw=1.0, ls=_DASHED, zorder=1)
    line.set_clip_path(inside)
    axes.plot(*plan.place.origin, "+", ms=18, color=ROCK, zorder=6)


def _draw_flight(axes: Any, plan: Plan) -> None:
    first, last = np.array(plan.slots_at(0)), np.array(plan.slots_at(plan.ticks))
    parents = plan.mission.layout.parent
    for slot, start in enumerate(np.array(plan.starts)):
        axes.plot(*np.array((start, first[slot], last[slot])).T, color=FAINT, lw=1.0, zorder=1)
        if parents[slot] != NO_PARENT:
            axes.plot(*np.array((last[slot], last[parents[slot]])).T, color=INK, lw=1.4, zorder=3)
        axes.plot(*start, "o", ms=8, color=INK, mew=0, zorder=5)
        axes.plot(*last[slot], "o", ms=8, color="white", mec=INK, mew=1.2, zorder=4)
        number(axes, slot, start)
        number(axes, slot, last[slot])
