"""What a flight in which things went wrong must keep: safety at every moment, and liveness once nothing goes wrong any more.

    safety      nobody collides; every view gives every slot to one drone; who knows the same believes the same; swaps come within
                the pauses; no swap is undone but for the reasons in docs/slots.md
    liveness    after the last trouble is over: all living drones come to one view, and to the goal in formation, in time

Who hears a lie that could be true believes it, so where drones know each other by radio alone a collision while somebody lies is
excused; where they see each other, none is.

What nobody could have prevented is no breach: a drone that hangs drifts on, so what it hits while it hangs, or before it can have
braked after, is counted as excused; so is what a dead drone hits that comes back where it died, perhaps amid the others.
"""

import re
from dataclasses import dataclass

from protocols.dynamics import TICK_S
from protocols.mission.document import Mission
from protocols.mission.fault import Fault
from rsc_swarm.flight.report import describe, missed_faults
from rsc_swarm.study.workers import Flight
from world.field import draw_slots

_BRAKING_S = 1.0  # from top speed, with a share of the acceleration that is kept for it
_SETTLING_S = (
    2.0  # for all to come to one view, besides the time after which a drone unheard is taken for dead
)


@dataclass(frozen=True)
class Broken:
    """What a flight did not keep: a name, the same for all flights that broke it; whether it is safety; and a sentence."""

    name: str
    safety: bool
    detail: str


@dataclass(frozen=True)
class Excused:
    """What looks broken, and nobody could have prevented."""

    detail: str


def judge(mission: Mission, flight: Flight) -> Broken | Excused | None:
    """What ``flight`` of ``mission`` did not keep, the worst of it; None: it kept all."""
    outcome, watched = flight.outcome, flight.watched
    detail = describe(outcome, mission, watched.breach)
    if watched.breach:
        return Broken(f"slots: {watched.breach.split(' at ')[0].split(':')[0]}", True, watched.breach)
    if outcome.struck_off:
        return Broken("a drone is struck off", True, detail)
    collided = outcome.rest_failure or outcome.failure
    if collided == "collision":
        nature = excuse(mission, outcome.closest)
        what = "an obstacle" if "obstacle" in outcome.closest else "each other"
        return Excused(f"{detail}: {nature}") if nature else Broken(f"drones hit {what}", True, detail)
    if watched.undone and not _may_undo(mission, flight):
        return Broken("a swap is undone", True, f"{watched.undone} swaps were undone, and nothing allowed it")
    if mission.fly_s is None and outcome.failure == "late":
        return Broken("not in formation in time", False, detail)
    if not watched.agreed and watched.agreed_after_s is None and _has_settled(mission, flight):
        return Broken(
            "views differ to the end", False, "the views of the slots were never equal after the last trouble"
        )
    return None


def excuse(mission: Mission, closest: str) -> str | None:
    """Why a collision could not be prevented, if so; ``closest`` as world.outcome tells it."""
    text = re.match(r"agents? (\d+) and (agent |obstacle )?(\d+) .* t = ([\d.]+) s", closest)
    if not text:
        return None
    agents = [int(text[1])] if "obstacle" in closest else [int(text[1]), int(text[3])]
    liars = range(mission.agents) if mission.sensing.neighbours == "heard" else ()
    at_s, slots = float(text[4]), draw_slots(mission).tolist()
    for who, spells, what in ((agents, _away, "hung, or was dead,"), (liars, _lied, "lied by radio")):
        for agent in who:
            for begin, end in spells(mission, agent, slots[agent]):
                if begin < at_s <= end + _BRAKING_S:
                    return f"agent {agent} {what} from {begin:g} to {end:g} s"
    return None


def _away(mission: Mission, agent: int, slot: int) -> list[tuple[float, float]]:
    """When the drone, which began in ``slot``, neither sensed nor answered: (from, to) in seconds."""
    spells, since, dead = [], None, False
    for fault in _befell(mission, agent, slot):
        if fault.kind in ("freeze", "kill"):
            since = fault.at_s if since is None else since
            dead = dead or fault.kind == "kill"
        elif since is not None and (fault.kind == "restart" or (fault.kind == "thaw" and not dead)):
            spells.append((since, fault.at_s))
            since, dead = None, False
    return spells if since is None else [*spells, (since, float("inf"))]


def _lied(mission: Mission, agent: int, slot: int) -> list[tuple[float, float]]:
    """When the drone, which began in ``slot``, lied by radio: (from, to) in seconds."""
    told = [fault for fault in _befell(mission, agent, slot) if fault.kind in ("lie", "truth")]
    ends = [*(fault.at_s for fault in told[1:]), float("inf")]
    return [(fault.at_s, end) for fault, end in zip(told, ends, strict=False) if fault.kind == "lie"]


def _befell(mission: Mission, agent: int, slot: int) -> list[Fault]:
    """The faults that struck this drone, in the order of time."""
    struck = [fault for fault in mission.faults if agent in fault.agents or slot in fault.slots]
    return sorted(struck, key=lambda fault: fault.at_s)


def _may_undo(mission: Mission, flight: Flight) -> bool:
    """Whether a swap may be undone: a promise timed out, a drone restarted, or a vacancy moved one of them (docs/slots.md)."""
    restarted = any(fault.kind == "restart" for fault in mission.faults)
    return bool(restarted or flight.swaps["timed_out"] or flight.swaps["vacated"])


def _has_settled(mission: Mission, flight: Flight) -> bool:
    last = max((fault.at_tick for fault in mission.faults), default=0)
    waited_s = (flight.outcome.ticks - last) * TICK_S
    return (
        not missed_faults(mission, flight.outcome.ticks)
        and waited_s > mission.silent_ticks * TICK_S + _SETTLING_S
    )
