"""What happened on the way, as marks on the paths: swaps, drones lost, faults of the mission, a collision."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from rsc_swarm.flight.recorded import Recorded
from rsc_swarm.show.plots.style import ALARM, INK, key, number

_FEW = 40  # swaps; more are drawn smaller


class Mark(NamedTuple):
    """How one kind of event looks, and the word that explains it."""

    word: str
    marker: str
    size: float
    face: str
    edge: str


SWAP = Mark("swap", "D", 4.5, "white", INK)
_LOST = Mark("lost", "X", 9.0, ALARM, "white")
#: Marks of what befalls one drone, which get its number, by kind of event.
NUMBERED = {
    "kill": _LOST,
    "lost": _LOST,
    "freeze": Mark("hung", "s", 6.5, "#d97706", "white"),
    "restart": Mark("restarted", "P", 9.0, "#0f9d76", "white"),
    "slow": Mark("slowed", "v", 7.5, "#8b4fc4", "white"),
    "lie": Mark("lied", "p", 7.5, "#8b4fc4", "white"),
}


def draw_events(axes: Any, track: Recorded) -> None:
    """Every event where it happened; those of one drone with its number."""
    swaps = np.array([*_swaps(track)]).reshape(-1, 2)
    size, edge = (SWAP.size, 1.0) if len(swaps) <= _FEW else (3.0, 0.7)
    axes.plot(*swaps.T, SWAP.marker, ms=size, mfc=SWAP.face, mec=SWAP.edge, mew=edge, zorder=7)
    for event in track.events:
        mark = NUMBERED.get(event.what)
        if mark and event.place_m:
            axes.plot(*event.place_m, mark.marker, ms=mark.size, mfc=mark.face, mec=mark.edge, zorder=7)
            number(axes, event.agents[0], event.place_m, colour=mark.face)
        elif event.what == "collision" and event.place_m:
            axes.plot(*event.place_m, "o", ms=22, mfc="none", mec=ALARM, mew=2.2, zorder=9)
            axes.annotate(
                "collision", event.place_m, (14, 14), textcoords="offset points", color=ALARM, fontsize=11,
                weight="bold", zorder=9,
            )  # fmt: skip


def event_handles(track: Recorded) -> list[Any]:
    """Entries of the legend, for the kinds of events that happened."""
    happened = {event.what for event in track.events}
    marks = ([SWAP] if any(True for _ in _swaps(track)) else []) + [
        mark for kind, mark in NUMBERED.items() if kind in happened
    ]
    return [
        key(mark.word, marker=mark.marker, ms=mark.size, mfc=mark.face, mec=mark.edge, lw=0)
        for mark in dict.fromkeys(marks)
    ]


def _swaps(track: Recorded) -> Iterator[tuple[float, float]]:
    """Where drones changed their slots, m."""
    for event in track.events:
        if event.slots:
            yield from track.path.positions[event.tick, list(event.agents)].tolist()
