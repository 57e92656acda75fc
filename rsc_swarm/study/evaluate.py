"""Many flights of one mission, and what they add up to: one row of a table.

Maps are the seeds ``seed_base`` to ``seed_base + maps - 1``; start k of map m flies with seed 1000 m + k.
Maps 0 to 199 are the test set; 1,000,000 and above are for training and tuning, so that no controller is
judged on maps it was made for.
"""

import math
from contextlib import closing, nullcontext
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

from pydantic import BaseModel, ConfigDict, Field

from protocols.mission.document import Mission, MissionError
from protocols.wire.status import SWAP_COUNTS
from rsc_swarm.flight.report import describe, missed_faults
from rsc_swarm.study.finished import FinishedFlights
from rsc_swarm.study.intervals import clustered
from rsc_swarm.study.machines import Crew, Who
from rsc_swarm.study.workers import Flight, Seeds, fly_all

STARTS_PER_MAP = 1000


class Failed(BaseModel):
    """A flight that failed."""

    model_config = ConfigDict(extra="forbid")

    map: int
    seed: int
    failure: str
    detail: str


class Evaluation(BaseModel):
    """Many flights of one mission, added up. Rates are shares of all runs, means over successful ones."""

    model_config = ConfigDict(extra="forbid")

    runs: int = Field(description="flights")
    success_rate: float = Field(description="S: share with the success that decides (mission field success)")
    success_interval: tuple[float, float] = Field(
        description="95 % interval of the success rate, by maps (rsc_swarm.study.intervals)"
    )
    paper_rate: float = Field(description="share with the paper's success, whichever decides")
    strict_rate: float = Field(description="share with the strict success (docs/task.md)")
    strict_interval: tuple[float, float] = Field(description="95 % interval of the strict rate, likewise")
    stood_on_rate: float = Field(
        description="share that had the paper's success and whose formation stood for 2 s after it"
    )
    agreed_at_success_rate: float = Field(
        description="share that had the paper's success and in which all living drones had one view of the slots then"
    )
    collision_rate: float = Field(description="C: two drones, or a drone and an obstacle, came too close")
    noncollision_rate: float = Field(description="D: every other failure, mostly no success in time")
    tau_mean_s: float | None = Field(description="mean time to success; null without a success")
    tau_max_s: float | None = Field(description="longest time to success")
    edge_error_mean: float | None = Field(
        description="mean over flights of the worst tree edge error at success, relative"
    )
    slot_error_mean_m: float | None = Field(
        description="mean over flights of the worst slot error at success"
    )
    slot_error_max_m: float | None = Field(description="the largest of them")
    min_distance_m: float | None = Field(description="smallest distance to anything in any run")
    min_distance_mean_m: float | None = Field(description="mean over all runs of the smallest distance")
    held_rate: float | None = Field(
        description="share of all runs whose formation held for hold_s; null if hold_s is 0"
    )
    formed_mean_s: float | None = Field(
        description="mean time at which the formation first stood, wherever that was, over flights in which it did"
    )
    breaches: int = Field(description="flights in which an invariant of the slot views was broken")
    disagreed: int = Field(description="flights at whose end the living drones' views of the slots differed")
    agreed_after_max_s: float | None = Field(
        description="longest time from the last fault until all views were equal, over flights in which they were"
    )
    agreed_in_1s_rate: float = Field(
        description="share of flights in which all views were equal within 1 s of the last fault"
    )
    allowed_after_max_s: float | None = Field(
        description="as agreed_after_max_s, had every delivered frame told all its sender knew: what the radio allowed"
    )
    allowed_in_1s_rate: float = Field(description="as agreed_in_1s_rate, of what the radio allowed")
    overlap_mean_s: float = Field(
        description="mean time during which drones claimed the same slot, summed over drones"
    )
    missed_faults: int = Field(
        description="flights that were over before all faults of the mission had happened"
    )
    swaps_per_flight: dict[str, float] = Field(description="mean over runs of the swarm's swap counts")
    failures: list[Failed] = Field(description="flights that failed: map, seed, failure, detail")
    maps: tuple[int, int] = Field(description="first and last map seed")
    starts: int = Field(description="flights on each map")
    code: str = Field(
        description="fingerprint of mission (without seeds) and code; equal ones are comparable"
    )
    mission: dict[str, Any] = Field(description="the mission, every field; its seeds are those of no flight")


class Watcher:
    """Told how an evaluation goes on; this one does not care."""

    def begin(self, known: list[Flight], missing: int) -> None:
        """These flights are known from the journal, so many are missing."""

    def ticks(self, flown: int) -> None:
        """So many more ticks have been flown, summed over flights."""

    def flight(self, flight: Flight) -> None:
        """One more flight has ended."""


def seeds_of(seed_base: int, maps: int, starts: int) -> list[Seeds]:
    """(map seed, start seed) of every run.

    Raises:
        MissionError: seeds that do not exist.
    """
    highest = 2**32 // STARTS_PER_MAP
    if maps < 1:
        raise MissionError("--maps: give at least 1")
    if not 1 <= starts <= STARTS_PER_MAP:
        raise MissionError(f"--starts: give 1 to {STARTS_PER_MAP} starts per map, not {starts}")
    if not 0 <= seed_base <= highest - maps:
        raise MissionError(
            f"--seed-base: map seeds end at {highest - 1}; give 0 to {highest - maps}, not {seed_base}"
        )
    return [
        (m, m * STARTS_PER_MAP + start) for m in range(seed_base, seed_base + maps) for start in range(starts)
    ]


class Amount(NamedTuple):
    """How much is flown, and by whom: ``starts`` flights on each of ``maps`` maps from ``seed_base`` on."""

    maps: int
    starts: int
    seed_base: int
    who: Who

    def seeds(self) -> list[Seeds]:
        """As `seeds_of`."""
        return seeds_of(self.seed_base, self.maps, self.starts)


def flown_on(maps: tuple[int, int], starts: int) -> str:
    """For people: ``maps`` (first and last seed) and the starts on each."""
    first, last = maps
    return f"maps {first} to {last}, {starts} start{'s' if starts > 1 else ''} each"


def evaluate(
    mission: Mission,
    seeds: list[Seeds],
    crew: Crew,
    journal: Path | None = None,
    watcher: Watcher | None = None,
) -> list[Flight]:
    """Fly ``mission`` once per pair of seeds; the flights in the order of ``seeds``.

    Args:
        crew: who flies. journal: keeps finished flights; those it already has are not flown again.

    Raises:
        WorkerError, FinishedFlightsError, and as rsc_swarm.flight.simulate.Simulation.
    """
    watcher = watcher or Watcher()
    with FinishedFlights(journal) if journal else nullcontext() as book:
        flights = {pair: book.finished[pair] for pair in seeds if pair in book.finished} if book else {}
        watcher.begin(list(flights.values()), len(seeds) - len(flights))
        missing = [pair for pair in seeds if pair not in flights]
        with closing(fly_all(mission, missing, crew.workers, crew.executor)) as flying:
            for said in flying:
                if isinstance(said, int):
                    watcher.ticks(said)
                    continue
                flights[said.map_seed, said.seed] = said
                if book:
                    book.add(said)
                watcher.flight(said)
    return [flights[pair] for pair in seeds]


def summarise(mission: Mission, flights: list[Flight], starts: int, code: str) -> Evaluation:
    """What ``flights`` (at least one) add up to; ``code`` is the `fingerprint` they were flown under."""
    runs = len(flights)
    outcomes = [flight.outcome for flight in flights]
    good = [outcome for outcome in outcomes if outcome.success]
    collisions = sum(outcome.failure == "collision" for outcome in outcomes)
    nearest = [outcome.min_distance_m for outcome in outcomes if math.isfinite(outcome.min_distance_m)]
    taus = [outcome.tau_s for outcome in good if outcome.tau_s is not None]
    formed = [outcome.formed_s for outcome in outcomes if outcome.formed_s is not None]
    agreed_after = [after for flight in flights if (after := flight.watched.agreed_after_s) is not None]
    allowed = [after for flight in flights if (after := flight.watched.allowed_after_s) is not None]
    maps = [flight.map_seed for flight in flights]
    held = (
        sum(outcome.held_after_success is True for outcome in outcomes) / runs if mission.hold_s > 0 else None
    )
    paper, strict = (sum(outcome.successes[which] for outcome in outcomes) for which in (0, 1))
    return Evaluation(
        runs=runs,
        paper_rate=paper / runs,
        strict_rate=strict / runs,
        strict_interval=clustered([outcome.successes[1] for outcome in outcomes], maps),
        stood_on_rate=sum(outcome.successes[0] and bool(outcome.stood_on) for outcome in outcomes) / runs,
        agreed_at_success_rate=sum(
            outcome.successes[0] and bool(outcome.agreed_at_success) for outcome in outcomes
        )
        / runs,
        success_rate=len(good) / runs,
        success_interval=clustered([outcome.success for outcome in outcomes], maps),
        collision_rate=collisions / runs,
        noncollision_rate=(runs - len(good) - collisions) / runs,
        tau_mean_s=fmean(taus) if taus else None,
        tau_max_s=max(taus, default=None),
        edge_error_mean=fmean(outcome.max_edge_error for outcome in good) if good else None,
        slot_error_mean_m=fmean(outcome.max_slot_error_m for outcome in good) if good else None,
        slot_error_max_m=max((outcome.max_slot_error_m for outcome in good), default=None),
        min_distance_m=min(nearest, default=None),
        min_distance_mean_m=fmean(nearest) if nearest else None,
        held_rate=held,
        formed_mean_s=fmean(formed) if formed else None,
        breaches=sum(flight.watched.breach is not None for flight in flights),
        disagreed=sum(not flight.watched.agreed for flight in flights),
        agreed_after_max_s=max(agreed_after, default=None),
        agreed_in_1s_rate=sum(after <= 1 for after in agreed_after) / runs,
        allowed_after_max_s=max(allowed, default=None),
        allowed_in_1s_rate=sum(after <= 1 for after in allowed) / runs,
        overlap_mean_s=fmean(outcome.overlap_s for outcome in outcomes),
        missed_faults=sum(bool(missed_faults(mission, outcome.ticks)) for outcome in outcomes),
        swaps_per_flight={name: fmean(flight.swaps[name] for flight in flights) for name in SWAP_COUNTS},
        failures=[_failed(flight, mission) for flight in flights if not flight.outcome.success],
        maps=(min(flight.map_seed for flight in flights), max(flight.map_seed for flight in flights)),
        starts=starts,
        code=code,
        mission=mission.model_dump(mode="json", exclude={"map_seed", "seed"}),
    )


def _failed(flight: Flight, mission: Mission) -> Failed:
    return Failed(
        map=flight.map_seed,
        seed=flight.seed,
        failure=str(flight.outcome.failure),
        detail=describe(flight.outcome, mission, flight.watched.breach),
    )
