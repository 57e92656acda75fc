"""The centralized experts, flown for evaluations: one mind sees all drones, so they are no policies that a drone could have.

``expert`` is ours, ``paper-expert`` the paper's (agent.control.apf). They fly in the batch simulation; what is told of the slot
protocol is empty.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from protocols.mission.document import Mission
from protocols.mission.policy_name import PAPERS_EXPERT
from protocols.wire.status import SWAP_COUNTS
from rsc_swarm.batch import batch, kernel, looking, stage
from rsc_swarm.batch.batch import Batch
from rsc_swarm.batch.stage import FLYING, LATE, SUCCEEDED
from world.invariants import Watched
from world.outcome import Judgement, Outcome
from world.referee import Verdict

_CODE = (*(str(part.__file__) for part in (batch, kernel, looking, stage)), __file__)
FILES = tuple(map(Path, _CODE))  # what besides the rules decides their flights
_ONE_VIEW = Watched(
    breach=None, views_differ_s=0.0, agreed_after_s=0.0, allowed_after_s=0.0, agreed=True, most_swaps_in_a_second=0, undone=0
)  # fmt: skip
_Ended = tuple[int, Outcome, Watched, dict[str, int]]  # world, and what a Flight tells of it


def fly_expert(missions: Sequence[Mission], every: int) -> Iterator[_Ended | int]:
    """Fly ``missions`` in step; yields flights as they end, and about every ``every`` ticks the ticks flown, summed over flights.

    Raises:
        protocols.mission.document.MissionError: the batch simulation cannot fly this. world.field.FieldError: no room to start.
    """
    flight = Batch(missions, ends=False, papers=missions[0].policy == PAPERS_EXPERT)
    worlds = flight.stage
    judgements = [Judgement(mission) for mission in missions]
    made = np.zeros(len(missions), np.int64)
    flown = 0
    while flying := np.flatnonzero(worlds.result == FLYING).tolist():
        flight.fly(1)
        flown += len(flying)
        if flown >= every * len(missions):
            yield flown
            flown = 0
        verdicts = worlds.findings.verdict.tolist()
        for world in flying:
            judgement, tick = judgements[world], int(worlds.ticks[world])
            judgement.settle(tick, Verdict._make(verdicts[world]), worlds.position[world])
            if judgement.decision is None:
                made[world] = worlds.swaps[world]
            if not judgement.over:
                continue
            worlds.result[world] = SUCCEEDED if judgement.decision == "" else LATE
            outcome = judgement.outcome(tick, "", worlds.flying[world])  # without a digest
            swaps = {**dict.fromkeys(SWAP_COUNTS, 0), "committed": int(made[world])}
            yield world, outcome, _ONE_VIEW, swaps
