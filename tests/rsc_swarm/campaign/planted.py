"""Does a campaign find what is wrong? Faults planted in rules of which each breaks something, and a hunt for them.

    python -m tests.rsc_swarm.campaign.planted                       # all; ends in 1 if one is not found, or not made short
    python -m tests.rsc_swarm.campaign.planted thaw --flights 500

For each it tells after how many flights it was found, what broke, with how many faults after shrinking, and whether the sound
code keeps all in that mission.
"""

import argparse
import inspect
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import agent.core
import world.core
from protocols.slots.agreement import SlotParty
from rsc_swarm import api
from rsc_swarm.campaign.budget import parse_budget
from rsc_swarm.campaign.campaign import fly, groups
from rsc_swarm.campaign.flying import Failure, Plan, fly_all
from rsc_swarm.campaign.judging import Broken, judge
from rsc_swarm.campaign.kept import keep
from rsc_swarm.study.machines import Crew
from rsc_swarm.study.workers import TASK

FLIGHTS = 2000  # within which each is to be found
FEW = 3  # faults that are left of its mission at most


@dataclass(frozen=True)
class Planted:
    """A rule and what it reads with the fault in it; and the campaign that looks for it.

    owner, rule: the module or class and the name of the function. sound, faulty: the words that are replaced, and by which.
    """

    owner: Any
    rule: str
    sound: str
    faulty: str
    fields: dict[str, Any]
    budget: str

    @contextmanager
    def in_place(self) -> Iterator[None]:
        """Fly with the fault, here and in the processes forked here."""
        with patch.object(
            self.owner, self.rule, _rewritten(getattr(self.owner, self.rule), self.sound, self.faulty)
        ):
            yield

    def plan(self, flights: int) -> Plan:
        """The campaign."""
        return Plan(api.mission(**self.fields), parse_budget(self.budget), 1, flights)


def _rewritten(rule: Callable[..., Any], sound: str, faulty: str) -> Callable[..., Any]:
    text = textwrap.dedent(inspect.getsource(rule))
    assert text.count(sound) == 1, f"{rule.__name__} no longer reads so: {sound}"
    made: dict[str, Any] = {}
    exec(compile(text.replace(sound, faulty), inspect.getfile(rule), "exec"), rule.__globals__, made)
    found: Callable[..., Any] = made[rule.__name__]
    return found


SCRAMBLED = {"agents": 9, "start": {"scrambled": True}}

PLANTED = {
    "consent": Planted(  # a drone that is promised to one agrees to another too
        SlotParty,
        "_weigh",
        "free = self.stance is Stance.IDLE or crossing or (renewed and tick < since + self._rules.lock_ticks)",
        "free = True",
        SCRAMBLED,
        "none,loss=0.2,burst=0.3,delay_ms=20,jitter_ms=20",
    ),
    "memory": Planted(  # a drone that has been restarted is still told what it remembered of the slots
        agent.core.SlotEndpoints,
        "restart",
        "self._refresh(row)",
        "pass",
        SCRAMBLED,
        "",
    ),
    "radius": Planted(  # drones keep clear of a collision radius that is not their mission's
        agent.core,
        "rules_of",
        "limits=limits_for(mission.limits.acceleration_mps2, mission.limits.collision_m)",
        "limits=limits_for(mission.limits.acceleration_mps2, 0.5)",
        SCRAMBLED | {"limits": {"collision_m": 0.9}},
        "none,kill=1,restart=1",
    ),
    "thaw": Planted(  # who hung and goes on is not heard any more
        world.core.faults, "strike", 'kind == "thaw"', 'kind == "thawed"', {"agents": 9}, "",
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Found:
    """How a hunt ended: flights flown, how many of them broke something, and the shortest mission that does, if one was found."""

    flights: int
    broken: int
    shortest: Failure | None

    @property
    def good(self) -> bool:
        """Whether it was found and made short."""
        return self.shortest is not None and len(self.shortest.mission.faults) <= FEW


def hunt(planted: Planted, most: int, crew: Crew, folder: Path) -> Found:
    """Fly until something breaks, a task for each worker at a time."""
    at_once = TASK * crew.workers
    with planted.in_place():
        for flights in range(at_once, most + at_once, at_once):
            plan = planted.plan(min(flights, most))
            tally = fly(plan, crew, folder, lambda *_: None)
            if tally.failures:
                return Found(plan.flights, len(tally.failures), groups(tally)[0].failures[0])
    return Found(most, 0, None)


def _told(name: str, found: Found, folder: Path, cpu_s: float) -> str:
    if not found.shortest:
        return f"{name}: not found in {found.flights} flights"
    mission = found.shortest.mission
    sound = judge(mission, fly_all([mission])[0])
    faults = ", ".join(fault.kind for fault in mission.faults) or "none"
    return (
        f"{name}: found within {found.flights} flights ({found.broken} broke something): {found.shortest.broken.name}; "
        f"{len(mission.faults)} faults after shrinking ({faults}); "
        f"the sound code {f'breaks it too ({sound.name})' if isinstance(sound, Broken) else 'keeps all'}; "
        f"{cpu_s:.0f} s; {keep(found.shortest, folder)}"
    )


def main() -> None:
    """Hunt for those named, or for all."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"which of {', '.join(PLANTED)}; all if left out"
    )
    parser.add_argument("--flights", type=int, default=FLIGHTS)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument(
        "--out", type=Path, default=Path("planted"), help="where the missions that show them go"
    )
    asked = parser.parse_args()
    if unknown := set(asked.names) - set(PLANTED):
        parser.error(f"no such fault: {', '.join(unknown)}")
    good = True
    for name in asked.names or PLANTED:
        begin = time.monotonic()
        with TemporaryDirectory() as journal:
            found = hunt(PLANTED[name], asked.flights, Crew(asked.workers), Path(journal))
        good &= found.good
        print(_told(name, found, asked.out / name, time.monotonic() - begin), flush=True)
    sys.exit(not good)


if __name__ == "__main__":
    main()
