"""What came of a flight: the referee's verdicts of all ticks, summed up, and a digest of every tick's state."""

import hashlib
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import TICK_S
from protocols.mission.document import Mission
from protocols.mission.fault import Fault
from protocols.wire.status import AgentStatus
from world.failsafe import CommandAges
from world.invariants import Watched
from world.referee import Verdict


class StruckOff(NamedTuple):
    """A drone that was taken out of a flight without the mission's doing: when, and why."""

    agent: int
    at_s: float
    why: str


@dataclass(frozen=True)
class Outcome:
    """How one flight ended. Distances in metres, times in seconds, errors relative to the edge length.

    formed_s: when the formation first stood, wherever that was; tau_s: when it stood beyond the goal line. In a run that broke
    (`as_broken`) rest_succeeded and rest_failure say how the flight of those who were left ended; else they are None.
    """

    success: bool
    failure: str | None
    ticks: int
    tau_s: float | None
    formed_s: float | None
    max_edge_error: float
    max_slot_error_m: float
    min_distance_m: float
    closest: str
    held_after_success: bool | None
    overlap_s: float
    lost_agents: tuple[int, ...]
    digest: str
    struck_off: tuple[StruckOff, ...] = ()
    rest_succeeded: bool | None = None
    rest_failure: str | None = None


def as_broken(outcome: Outcome, struck_off: tuple[StruckOff, ...], breach: str | None) -> Outcome:
    """The outcome of a flight in which drones were ``struck_off`` or an invariant of the slots broke, if that was so.

    Such a run says nothing about the controller: it is neither a success nor a failure of it.
    """
    outcome = replace(outcome, struck_off=struck_off)
    if not (struck_off or breach) or outcome.failure == "interrupted":
        return outcome
    return replace(
        outcome,
        success=False,
        failure="broken",
        rest_succeeded=outcome.success,
        rest_failure=outcome.failure,
    )


@dataclass(frozen=True)
class Flown:
    """A flight and its figures. tally: per world.medium.medium.TALLY. statuses: each drone's last account. by_hand: faults that
    somebody who looked on brought about; with them the mission flies so again."""

    outcome: Outcome
    tally: dict[str, int]
    statuses: dict[int, AgentStatus]
    watched: Watched
    wall_s: float
    real_time_factor: float
    median_frame_bytes: float
    message_bytes: tuple[float, float]  # mean size of a drone's REPLY and of the world's TICK
    first_tick_at: float  # time.time()
    command_ages: CommandAges | None  # in real time
    by_hand: tuple[Fault, ...] = ()

    @property
    def deadline_misses(self) -> int:
        """Answers that came too late for their tick."""
        return self.command_ages.misses if self.command_ages else 0


class Judgement:
    """Sums up the flight of one world, tick by tick."""

    def __init__(self, mission: Mission) -> None:
        self._last_tick, self._hold_s, self._hold_ticks = (
            mission.ticks,
            mission.hold_s,
            round(mission.hold_s / TICK_S),
        )
        self._closest = np.inf
        self._closest_text = "nobody came near anybody"
        self._overlap_ticks = 0
        self._formed_tick = self._tau_tick = -1
        self._verdict = self._at_tau = Verdict()
        self._held = True
        self._hash = hashlib.blake2b(digest_size=16)

    def digest(self, state: tuple[NDArray[Any], ...]) -> None:
        """Take what is so after this tick into the digest."""
        for array in state:
            self._hash.update(array.data)

    def settle(self, tick: int, verdict: Verdict, position: NDArray[np.float64]) -> str | None:
        """What the referee's ``verdict`` on this tick means for the flight.

        Args:
            position: (N, 2) where the drones are.

        Returns:
            None while it goes on, else why it ends; "" if it ends in success.
        """
        self._verdict = verdict
        self._overlap_ticks += verdict.shared_slots
        closest = min(verdict.closest_agents_m, verdict.closest_obstacle_m)
        if closest < self._closest:
            self._closest = closest
            self._closest_text = _describe_closest(tick, verdict, position)
        if self._formed_tick < 0 and verdict.standing:
            self._formed_tick = tick
        if self._tau_tick >= 0:
            self._held &= verdict.formed
        elif verdict.formed:
            self._tau_tick = tick
            self._at_tau = verdict
        if verdict.collided:
            return "collision"
        if self._tau_tick < 0:
            return "late" if tick >= self._last_tick else None
        return "" if self._tau_tick <= tick - self._hold_ticks else None

    def outcome(self, tick: int, failure: str, flying: NDArray[np.bool_]) -> Outcome:
        """How the flight ended; ``failure`` as `settle` gives it, ``flying``: (N,)."""
        tau, formed = self._tau_tick, self._formed_tick
        verdict = self._at_tau if tau >= 0 else self._verdict
        return Outcome(
            success=not failure,
            failure=failure or None,
            ticks=tick,
            tau_s=round(tau * TICK_S, 2) if tau >= 0 else None,
            formed_s=round(formed * TICK_S, 2) if formed >= 0 else None,
            max_edge_error=verdict.edge_error,
            max_slot_error_m=verdict.slot_error_m,
            min_distance_m=float(self._closest),
            closest=self._closest_text,
            held_after_success=self._held if not failure and self._hold_s > 0 else None,
            overlap_s=self._overlap_ticks * TICK_S,
            lost_agents=tuple(int(agent) for agent in np.flatnonzero(~flying)),
            digest=self._hash.hexdigest(),
        )


def _describe_closest(tick: int, verdict: Verdict, position: NDArray[np.float64]) -> str:
    if verdict.closest_agents_m <= verdict.closest_obstacle_m:
        first, second = verdict.agent_a, verdict.agent_b
        x, y = (position[first] + position[second]) / 2
        who = f"agents {first} and {second}"
    else:
        agent = verdict.agent_c
        x, y = position[agent]
        who = f"agent {agent} and obstacle {verdict.obstacle}"
    return f"{who} at x = {x:.1f} m, y = {y:.1f} m, t = {tick * TICK_S:.2f} s"
