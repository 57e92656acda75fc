"""Flights in real processes in which one drone attacks the others, and what they cost the others."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import psutil
from pydantic import TypeAdapter

from protocols.dynamics import TICK_S
from protocols.mission.document import Mission
from rsc_swarm.flight.launch import launch
from rsc_swarm.machine.leaving import passing_folder
from rsc_swarm.selfcheck.attacks import ATTACKS, after_a_while
from rsc_swarm.selfcheck.insider import Insider
from rsc_swarm.selfcheck.judging import without
from rsc_swarm.study.finished import Journal
from world.outcome import Outcome
from world.outlets.snapshot import Snapshot
from world.outlets.trajectory import Trajectory

_MB = 1e6


class Trial(NamedTuple):
    """One flight with an insider.

    honest_lost: drones lost besides it. succeeded: whether the others did what the mission asks. wall_s: from the first tick to
    the last; slowdown: that per simulated second, divided by the same of a flight without an attack. world_mb: the most
    that the world's process held. insider: what became of it.
    """

    attack: str
    map_seed: int
    honest_lost: tuple[int, ...]
    succeeded: bool
    failure: str | None
    wall_s: float
    slowdown: float
    world_mb: float
    insider: str


_TRIAL = TypeAdapter(Trial)


class FinishedTrials(Journal[tuple[str, int], Trial]):
    """Trials flown so far, by attack and map."""

    @staticmethod
    def _key(record: Trial) -> tuple[str, int]:
        return record.attack, record.map_seed

    @staticmethod
    def _parse(line: str) -> Trial | None:
        try:
            return _TRIAL.validate_json(line)
        except ValueError:
            return None

    @staticmethod
    def _fields(record: Trial) -> dict[str, Any]:
        return record._asdict()


class _Flight(NamedTuple):
    outcome: Outcome
    rest: Outcome
    wall_s: float
    world_mb: float

    @property
    def pace(self) -> float:
        """Wall-clock seconds per simulated one."""
        return self.wall_s / max(self.outcome.ticks * TICK_S, TICK_S)


def trials(
    missions: Sequence[Mission],
    names: Sequence[str],
    turned: int,
    seed: int,
    book: FinishedTrials | None = None,
) -> Iterator[Trial]:
    """Fly every attack on every mission, with drone ``turned`` as the insider, but those that are in the ``book``.

    Raises:
        FinishedFlightsError: the book cannot be written. SwarmError: as rsc_swarm.flight.launch.launch.
    """
    for mission in missions:
        kept = book.finished if book else {}
        missing = [name for name in names if (name, mission.map_seed) not in kept]
        calm = _fly(mission, None, turned, seed) if missing else None
        for name in names:
            if calm and name in missing:
                trial = _told(name, mission, turned, _fly(mission, name, turned, seed), calm)
                if book:
                    book.add(trial)
                yield trial
            else:
                yield kept[name, mission.map_seed]


def _told(name: str, mission: Mission, turned: int, flight: _Flight, calm: _Flight) -> Trial:
    outcome = flight.outcome
    fate = next((struck.why for struck in outcome.struck_off if struck.agent == turned), "flew to the end")
    return Trial(
        attack=name,
        map_seed=mission.map_seed,
        honest_lost=tuple(agent for agent in outcome.lost_agents if agent != turned),
        succeeded=flight.rest.success,
        failure=flight.rest.failure,
        wall_s=flight.wall_s,
        slowdown=flight.pace / calm.pace,
        world_mb=flight.world_mb,
        insider=fate,
    )


def _fly(mission: Mission, attack: str | None, turned: int, seed: int) -> _Flight:
    most = [0.0]

    def weigh(_picture: Snapshot) -> None:
        with suppress(psutil.NoSuchProcess, ValueError):  # the last picture may come when all have ended
            world = min(psutil.Process().children(), key=lambda child: child.pid)  # it is started first
            most[0] = max(most[0], world.memory_info().rss / _MB)

    insiders = {turned: Insider(after_a_while(ATTACKS[attack]), seed)} if attack else {}
    with passing_folder() as folder:
        launched = launch(mission, run_dir=folder, on_snapshot=weigh, insiders=insiders)
        flown = launched.whole()
        path = Trajectory.load(folder / "trajectory.npz")
    return _Flight(flown.outcome, without(mission, path, turned), flown.wall_s, most[0])


class Row(NamedTuple):
    """All trials of one attack."""

    attack: str
    tries: str
    flights: int
    honest_lost: int
    succeeded: int
    slowdown: float
    world_mb: float
    insider: str


def rows(tried: Sequence[Trial]) -> list[Row]:
    """The trials, attack by attack; slowdown is the median, memory the most."""
    table = []
    for name in dict.fromkeys(trial.attack for trial in tried):
        mine = [trial for trial in tried if trial.attack == name]
        paces = sorted(trial.slowdown for trial in mine)
        table.append(
            Row(
                attack=name,
                tries=(ATTACKS[name].__doc__ or "").strip(),
                flights=len(mine),
                honest_lost=sum(len(trial.honest_lost) for trial in mine),
                succeeded=sum(trial.succeeded for trial in mine),
                slowdown=paces[len(paces) // 2],
                world_mb=max(trial.world_mb for trial in mine),
                insider=mine[0].insider,
            )
        )
    return table


def passes(tried: Sequence[Trial]) -> bool:
    """Whether nobody honest was lost, and the others succeeded in 95 of 100 flights."""
    return not any(trial.honest_lost for trial in tried) and sum(
        trial.succeeded for trial in tried
    ) >= 0.95 * len(tried)
