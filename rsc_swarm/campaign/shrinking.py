"""The shortest mission that still breaks the same way.

Hypothesis shrinks what it has drawn, one candidate after the other. What it cannot do is to fly many in step, which is
several times quicker; so a mission with only a few of the troubles is looked for first, and Hypothesis finds those flights done.
"""

from contextlib import suppress
from dataclasses import replace
from itertools import combinations

from hypothesis import Phase, given, settings
from hypothesis import seed as seeded

from protocols.mission.document import Mission
from rsc_swarm.campaign.flying import QUIET, Failure, Plan, fly_all
from rsc_swarm.campaign.judging import Broken, judge
from rsc_swarm.campaign.strategies import Schedule, schedules

_FEW = 3  # troubles; a mission that breaks with so many is short enough
_MOST = 60  # flights that Hypothesis may ask for; what has not been flown by then counts as sound


class _Breaks(Exception):
    """This mission does."""


class _Search:
    """Flies candidates, each once."""

    def __init__(self, found: Failure) -> None:
        self._found = self.shortest = found
        self._known: dict[str, Failure | None] = {}
        self._asked = 0

    def try_out(self, schedule: Schedule) -> None:
        """Raise `_Breaks` if this one breaks as the one did that was found."""
        mission = schedule.mission
        if not self._known:
            if mission != self._found.mission:
                return  # Hypothesis comes by what it drew before
            self._know([mission])
            self._with_few(schedule)
        if (mission.map_seed, mission.seed) != (self._found.mission.map_seed, self._found.mission.seed):
            return  # the map and the start stay
        if _key(mission) not in self._known and self._asked < _MOST:
            self._asked += 1
            self._know([mission])
        if self._known.get(_key(mission)):
            raise _Breaks

    def _with_few(self, schedule: Schedule) -> None:
        """Leave out all but one, two or three of the troubles: the first number with which it breaks is the least."""
        for few in range(min(_FEW, len(schedule.troubles) - 1) + 1):
            subsets = combinations(schedule.troubles, few)
            if self._know([replace(schedule, troubles=troubles).mission for troubles in subsets]):
                return

    def _know(self, missions: list[Mission]) -> bool:
        """Fly these, those already flown left aside; whether one breaks."""
        new = list(
            {_key(mission): mission for mission in missions if _key(mission) not in self._known}.values()
        )
        found = False
        for mission, flight in zip(new, fly_all(new), strict=True):
            broken = judge(mission, flight)
            failure = None
            if isinstance(broken, Broken) and broken.name == self._found.broken.name:
                failure = replace(self._found, broken=broken, mission=mission, digest=flight.outcome.digest)
            self._known[_key(mission)] = failure
            if failure and _length(failure) < _length(self.shortest):
                self.shortest = failure
            found |= failure is not None
        return found


def shrink(plan: Plan, found: Failure) -> Failure:
    """The shortest mission that breaks as ``found`` does, on its map and from its start."""
    search = _Search(found)

    @seeded(plan.draw(found.task))
    @settings(
        QUIET,
        max_examples=plan.size(found.task),
        phases=[Phase.generate, Phase.shrink],
        report_multiple_bugs=False,
    )
    @given(schedules(plan.mission, plan.budget, plan.draw(found.task)))
    def breaks(schedule: Schedule) -> None:
        search.try_out(schedule)

    with suppress(_Breaks):
        breaks()
    return replace(search.shortest, shrunk=True)


def _key(mission: Mission) -> str:
    return mission.model_dump_json()


def _length(failure: Failure) -> tuple[int, int, float]:
    """Fewer faults, then a radio that is more as the mission has it, then earlier ones and shorter to tell."""
    mission = failure.mission
    radio = mission.radio.model_dump_json(exclude_defaults=True)
    return len(mission.faults), len(radio), sum(fault.at_s for fault in mission.faults)
