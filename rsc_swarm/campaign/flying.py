"""The flights of a campaign: tasks of so many, drawn by Hypothesis, flown in step where their radios are one.

A task is a function of its arguments: the same wherever and whenever it is flown.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from hypothesis import HealthCheck, Phase, Verbosity, given, settings
from hypothesis import seed as seeded

from protocols.mission.document import Mission
from rsc_swarm.campaign.budget import Budget
from rsc_swarm.campaign.judging import Broken, Excused, judge
from rsc_swarm.campaign.steady import STEADY
from rsc_swarm.campaign.strategies import missions
from rsc_swarm.flight.simulate import flights_at_once
from rsc_swarm.study.workers import TASK, Flight, fly_together

QUIET = settings(
    backend=STEADY, database=None, deadline=None, suppress_health_check=list(HealthCheck), verbosity=Verbosity.quiet,
    print_blob=False,
)  # fmt: skip


@dataclass(frozen=True)
class Plan:
    """What a campaign flies."""

    mission: Mission
    budget: Budget
    seed: int
    flights: int

    @property
    def tasks(self) -> int:
        """In how many tasks: `TASK` flights each, the last one fewer."""
        return -(-self.flights // TASK)

    def size(self, task: int) -> int:
        """Flights of this task."""
        return min(TASK, self.flights - task * TASK)

    def draw(self, task: int) -> int:
        """The seed of what is drawn for this task."""
        return self.seed * 2**32 + task


@dataclass(frozen=True)
class Failure:
    """A flight that did not keep something: what, the mission that does so, the digest of that flight, and in which task it
    was found. faults: how many the mission had when it was found; shrunk: whether it has been made as short as it goes."""

    broken: Broken
    mission: Mission
    digest: str
    task: int
    faults: int
    shrunk: bool = False


@dataclass
class Tally:
    """What tasks add up to."""

    flights: int = 0
    ticks: int = 0
    excused: int = 0
    failures: list[Failure] = field(default_factory=list)

    def add(self, other: "Tally") -> None:
        """Count another's too."""
        self.flights += other.flights
        self.ticks += other.ticks
        self.excused += other.excused
        self.failures += other.failures


def drawn(plan: Plan, task: int) -> list[Mission]:
    """The missions of a task."""
    found: list[Mission] = []

    @seeded(plan.draw(task))
    @settings(QUIET, max_examples=plan.size(task), phases=[Phase.generate])
    @given(missions(plan.mission, plan.budget, plan.draw(task)))
    def collect(mission: Mission) -> None:
        found.append(mission)

    collect()
    return found


def fly_task(plan: Plan, task: int) -> Tally:
    """Draw and fly a task, and judge its flights."""
    tally = Tally()
    missions = drawn(plan, task)
    for mission, flight in zip(missions, fly_all(missions), strict=True):
        tally.flights += 1
        tally.ticks += flight.outcome.ticks
        found = judge(mission, flight)
        if isinstance(found, Excused):
            tally.excused += 1
        elif found:
            tally.failures.append(Failure(found, mission, flight.outcome.digest, task, len(mission.faults)))
    return tally


def fly_all(missions: Sequence[Mission], both: bool = False) -> list[Flight]:
    """Fly missions that agree in all but seeds, faults and radios; the flights in their order.

    Args:
        both: judge both successes; what a campaign asks for is known before.
    """
    flights: dict[int, Flight] = {}
    by_radio: dict[str, list[int]] = {}
    for place, mission in enumerate(missions):
        by_radio.setdefault(mission.radio.model_dump_json(), []).append(place)
    for places in by_radio.values():
        bunches = -(-len(places) // flights_at_once(missions[places[0]]))
        for first in range(bunches):
            # Bunches of a size: a small one takes nearly as long as a large one.
            together = places[first::bunches]
            for said in fly_together([missions[place] for place in together], both):
                if not isinstance(said, int):
                    flights[together[said[0]]] = said[1]
    return [flights[place] for place in range(len(missions))]
