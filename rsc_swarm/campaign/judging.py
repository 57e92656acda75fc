"""What a flight in which things went wrong must keep: safety at every moment, and liveness once nothing goes wrong any more.

    safety      nobody collides; every view gives every slot to one drone; who knows the same believes the same; swaps come within
                the pauses; no swap is undone but for the reasons in docs/slots.md
    liveness    after the last trouble is over: all living drones come to one view, and to the goal in formation, in time

Where drones know each other by radio alone, who hears a lie that could be true believes it, and who is parted from another knows
nothing of it as soon as its last frame is too old: then collisions are excused. Where they see each other, none is.

What nobody could have prevented is no breach: a drone that hangs drifts on, so what it hits while it hangs, or before it can have
braked after, is counted as excused; so is what a dead drone hits that comes back where it died, perhaps amid the others.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass

from protocols.dynamics import TICK_S
from protocols.mission.document import Mission
from protocols.mission.fault import Fault
from rsc_swarm.flight.report import describe, missed_faults
from rsc_swarm.study.workers import Flight
from world.field import draw_slots

_BRAKING_S = 1.0  # from top speed, with a share of the acceleration that is kept for it
# For all to come to one view, besides the time after which a drone unheard is taken for dead.
_SETTLING_S = 2.0


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
    at_s = float(text[4])
    for what, begin, end in _reasons(mission, agents):
        if begin < at_s <= end + _BRAKING_S:
            return f"{what} from {begin:g} to {end:g} s"
    return None


def _reasons(mission: Mission, agents: list[int]) -> Iterator[tuple[str, float, float]]:
    """Why these, one drone or two that met, could not keep clear: what was so, and from when to when, in seconds."""
    slots = draw_slots(mission).tolist()
    for agent in agents:
        for begin, end in _away(mission, agent, slots[agent]):
            yield f"agent {agent} hung, or was dead,", begin, end
    if mission.sensing.neighbours == "heard":
        for agent in range(mission.agents):
            for begin, end in _lied(mission, agent, slots[agent]):
                yield f"agent {agent} lied by radio", begin, end
        for begin, end in _parted(mission, *agents):
            yield "they knew nothing of each other", begin + mission.memory_ticks * TICK_S, end


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


def _parted(mission: Mission, one: int, other: int | None = None) -> list[tuple[float, float]]:
    """When the radio was parted between two drones: (from, to) in seconds. None where there is but one."""
    spells, since = [], None
    for fault in sorted(mission.faults, key=lambda fault: fault.at_s):
        if fault.kind not in ("part", "heal") or other is None:
            continue
        sides = [
            next((side for side, group in enumerate(fault.groups) if who in group), -1)
            for who in (one, other)
        ]
        if sides[0] != sides[1]:
            since = fault.at_s if since is None else since
        elif since is not None:
            spells.append((since, fault.at_s))
            since = None
    return spells if since is None else [*spells, (since, float("inf"))]


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
