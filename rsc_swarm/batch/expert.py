"""The centralized expert, flown for evaluations: one mind sees all drones, so it is no policy that a drone could have.

It flies in the batch simulation, without radio; what is told of the slot protocol is empty.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from protocols.mission.document import Mission
from protocols.wire.status import SWAP_COUNTS
from rsc_swarm.batch import batch
from rsc_swarm.batch import kernel as batch_kernel
from rsc_swarm.batch.batch import Batch
from rsc_swarm.batch.kernel import FLYING
from world.invariants import Watched
from world.outcome import Outcome

EXPERT = "expert"
FILES = (Path(batch.__file__), Path(batch_kernel.__file__))  # what besides the rules decides its flights
_ONE_VIEW = Watched(
    breach=None, views_differ_s=0.0, agreed_after_s=0.0, allowed_after_s=0.0, agreed=True, most_swaps_in_a_second=0, undone=0
)  # fmt: skip
_Ended = tuple[int, Outcome, Watched, dict[str, int]]  # world, and what a Flight tells of it


def fly_expert(missions: Sequence[Mission], every: int) -> Iterator[_Ended | int]:
    """Fly ``missions`` in step; yields flights as they end, and every ``every`` ticks the ticks flown, summed over flights.

    Raises:
        protocols.mission.document.MissionError: the batch simulation cannot fly this. world.field.FieldError: no room to start.
    """
    flight = Batch(missions)
    while (flying := flight.stage.result == FLYING).any():
        before = int(flight.stage.ticks.sum())
        flight.fly(every)
        yield int(flight.stage.ticks.sum()) - before
        for world in np.flatnonzero(flying & (flight.stage.result != FLYING)).tolist():
            swaps = {**dict.fromkeys(SWAP_COUNTS, 0), "committed": int(flight.stage.swaps[world])}
            yield world, flight.outcome(world), _ONE_VIEW, swaps
