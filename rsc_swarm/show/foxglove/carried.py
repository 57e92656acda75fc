"""What became of the frames of a flight, which nobody writes down: it is flown again."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from protocols.errors import SwarmError
from rsc_swarm.flight.again import fly_again
from rsc_swarm.flight.recorded import Recorded
from world.outlets.picture import links_of

FATES = ("carried", "lost", "delayed")  #: as world.medium.medium.FATES


class Carried:
    """links: by row, (L, 3): from, to, and a bit for each of `FATES` that frames met there in the last 0.2 s."""

    def __init__(self, links: dict[int, NDArray[np.int16]]) -> None:
        self._links = links

    def with_fate(self, row: int, fate: str) -> list[tuple[int, int]]:
        """Between whom frames met this fate, in whichever direction: each pair once, in order, the lower number first."""
        place = FATES.index(fate)
        return sorted(
            {(min(a, b), max(a, b)) for a, b, bits in self._links[row].tolist() if bits >> place & 1}
        )

    def told(self, row: int) -> list[dict[str, Any]]:
        """The same as plain fields."""
        return [
            {"source": a, "destination": b}
            | {fate: bool(bits >> place & 1) for place, fate in enumerate(FATES)}
            for a, b, bits in self._links[row].tolist()
        ]


def carried_in(recorded: Recorded, every: int) -> Carried | None:
    """What became of the frames, at every so many rows and the last one; None if it cannot be flown again as it was."""
    report, last = recorded.report, len(recorded.path.slots) - 1
    if report is None or last != report.ticks:
        return None
    try:
        return Carried(
            {
                director.clock: links_of(director.core.fates[0], director.clock)
                for director in fly_again(recorded.mission, report.clock, report.ticks, report.digest)
                if director.clock % every == 0 or director.clock == last
            }
        )
    except SwarmError:
        return None
