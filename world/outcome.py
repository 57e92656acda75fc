"""What came of a flight: the referee's verdicts of all ticks, summed up.

There are two successes; a mission's field ``success`` says which one decides, and the other is always judged, too:

    paper   the first tick at which the formation stands beyond the goal line (world.referee)
    strict  the first tick from which on, for STRICT_HOLD_S, it stands there, every drone is less than STRICT_SLOT_M from the
            place of its slot, and all living drones agree who is in which: so a slot is not only what one claims for itself

A flight is decided by one of them. If the other is then still open, all fly on until it is not, at most to the time limit and
STRICT_HOLD_S more. Nothing that is told of the flight but the other success comes from there, neither its length nor its digest.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import TICK_S, ticks_of
from protocols.mission.document import Mission
from protocols.mission.fault import Fault
from protocols.wire.status import AgentStatus
from world.failsafe import CommandAges
from world.invariants import Watched
from world.referee import Verdict

STRICT_SLOT_M = 1.0
STRICT_HOLD_S = 2.0
_STRICT_HOLD_TICKS = ticks_of(STRICT_HOLD_S)


class StruckOff(NamedTuple):
    """A drone that was taken out of a flight without the mission's doing: when, and why."""

    agent: int
    at_s: float
    why: str


@dataclass(frozen=True)
class Outcome:
    """How one flight ended. Distances in metres, times in seconds, errors relative to the edge length.

    formed_s: when the formation first stood, wherever that was; tau_s: time of the success that decides. In a run that broke
    (`as_broken`) rest_succeeded and rest_failure say how the flight of those who were left ended; else they are None.
    paper_tau_s, strict_tau_s: times of both successes, None without. stood_on, agreed_at_success: whether the formation stood
    for STRICT_HOLD_S from paper_tau_s on, and whether all views of the slots were equal then; None without such a success.
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
    paper_tau_s: float | None = None
    strict_tau_s: float | None = None
    stood_on: bool | None = None
    agreed_at_success: bool | None = None

    @property
    def successes(self) -> tuple[bool, bool]:
        """Whether there was the paper's success, and the strict one; neither in a run that broke."""
        counts = self.failure != "broken"
        return counts and self.paper_tau_s is not None, counts and self.strict_tau_s is not None


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
    """Sums up the flight of one world, tick by tick.

    decision: what it came to by the success that decides: "" a success, else why not; None while that is open. over: the other
    one is settled, too, if both are asked for.
    """

    def __init__(self, mission: Mission, both: bool = True) -> None:
        self._both = both
        self._last_tick = mission.ticks
        self._hold_s, self._hold_ticks = mission.hold_s, ticks_of(mission.hold_s)
        self._by_strict = mission.success == "strict"
        self._closest = np.inf
        self._at_closest: tuple[int, Verdict, NDArray[np.float64]] | None = None  # tick, and what was so then
        self._overlap_ticks = 0
        self._formed_tick = self._tau_tick = self._decided_tick = -1
        self._verdict = self._at_tau = Verdict()
        self._held = True
        self._strict = _Strict(mission.ticks)
        self.decision: str | None = None
        self.over = False

    def settle(self, tick: int, verdict: Verdict, position: NDArray[np.float64], agreed: bool = True) -> None:
        """Judge on by the referee's ``verdict`` on this tick.

        Args:
            position: (N, 2) where the drones are. agreed: all living drones have one view of the slots.
        """
        self._strict.follow(tick, verdict, agreed)
        if self.decision is None:
            self._sum_up(tick, verdict, position)
            self.decision, self._decided_tick = self._decide(tick, verdict), tick
        self.over = self.decision is not None and (
            not self._both or verdict.collided or self._strict.known(tick)
        )

    def _sum_up(self, tick: int, verdict: Verdict, position: NDArray[np.float64]) -> None:
        self._verdict = verdict
        self._overlap_ticks += verdict.shared_slots
        closest = min(verdict.closest_agents_m, verdict.closest_obstacle_m)
        if closest < self._closest:
            self._closest = closest
            self._at_closest = tick, verdict, position.copy()
        if self._formed_tick < 0 and verdict.standing:
            self._formed_tick = tick
        if self._tau_tick >= 0:
            self._held &= verdict.formed
        elif self._by_strict:
            self._tau_tick, self._at_tau = self._strict.tau_tick, self._strict.at_tau
        elif verdict.formed:
            self._tau_tick, self._at_tau = tick, verdict

    def _decide(self, tick: int, verdict: Verdict) -> str | None:
        if verdict.collided:
            return "collision"
        if self._tau_tick < 0:
            late = self._strict.hopeless(tick) if self._by_strict else tick >= self._last_tick
            return "late" if late else None
        return "" if self._tau_tick <= tick - self._hold_ticks else None

    def outcome(self, tick: int, failure: str, flying: NDArray[np.bool_], digest: str = "") -> Outcome:
        """How the flight ended, at ``tick`` and by ``failure`` unless it was decided before; ``flying``: (N,). ``digest``: of
        its states, as world.digest has it."""
        if self.decision is not None:
            tick, failure = self._decided_tick, self.decision
        tau, formed, strict = self._tau_tick, self._formed_tick, self._strict
        verdict = self._at_tau if tau >= 0 else self._verdict
        return Outcome(
            success=not failure,
            failure=failure or None,
            ticks=tick,
            tau_s=_seconds(tau),
            formed_s=_seconds(formed),
            max_edge_error=verdict.edge_error,
            max_slot_error_m=verdict.slot_error_m,
            min_distance_m=float(self._closest),
            closest=_describe_closest(*self._at_closest) if self._at_closest else "nobody came near anybody",
            held_after_success=self._held if not failure and self._hold_s > 0 else None,
            overlap_s=self._overlap_ticks * TICK_S,
            lost_agents=tuple(int(agent) for agent in np.flatnonzero(~flying)),
            digest=digest,
            paper_tau_s=_seconds(strict.formed_tick),
            strict_tau_s=_seconds(strict.tau_tick),
            stood_on=strict.stood if self._both and strict.formed_tick >= 0 else None,
            agreed_at_success=strict.agreed if strict.formed_tick >= 0 else None,
        )


class _Strict:
    """Follows the strict success, and what the paper's one lacks of it.

    formed_tick: of the paper's success. stood, agreed: as Outcome's stood_on and agreed_at_success. tau_tick, at_tau: of the
    strict success, and the verdict then. Ticks are -1 before.
    """

    def __init__(self, last_tick: int) -> None:
        self._last_tick = last_tick
        self._since = -1  # tick from which on all has been strictly right
        self.formed_tick = self.tau_tick = -1
        self._at_since = self.at_tau = Verdict()
        self.stood, self.agreed = True, False

    def follow(self, tick: int, verdict: Verdict, agreed: bool) -> None:
        formed = verdict.formed and not verdict.collided
        if not formed and self.formed_tick < 0:
            self._since = -1
            return
        if formed and self.formed_tick < 0:
            self.formed_tick, self.agreed = tick, agreed
        if self.formed_tick >= 0 and tick <= self.formed_tick + _STRICT_HOLD_TICKS:
            self.stood &= formed
        if not (formed and agreed and verdict.slot_error_m < STRICT_SLOT_M):
            self._since = -1
        elif self._since < 0 and tick <= self._last_tick:
            self._since, self._at_since = tick, verdict
        if self.tau_tick < 0 <= self._since <= tick - _STRICT_HOLD_TICKS:
            self.tau_tick, self.at_tau = self._since, self._at_since

    def hopeless(self, tick: int) -> bool:
        """Whether the strict success did not come in time."""
        return self.tau_tick < 0 and self._since < 0 and tick >= self._last_tick

    def known(self, tick: int) -> bool:
        """Whether nothing that is still to come can change what is said here."""
        watched = not self.stood or self.formed_tick < 0 or tick >= self.formed_tick + _STRICT_HOLD_TICKS
        return watched and (self.tau_tick >= 0 or self.hopeless(tick))


def _seconds(tick: int) -> float | None:
    return round(tick * TICK_S, 2) if tick >= 0 else None


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
