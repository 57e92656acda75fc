"""WorldCore: one tick of nature for E worlds at once, without IO.

A flight in real processes is one world (E = 1); a batch flies many worlds of the same size and rules that differ in their
seeds. A tick has two halves, between which the drones decide (`world.director` is who calls them):

    begin_tick   what the mission says goes wrong now
    perceive     what every drone's sensors see, and the frames that reach it
    advance      the drones' answers: move, relay, judge

Row r of every per-drone array is agent r % N of world r // N.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import TICK_S
from protocols.kernels import bound, by_reference, rebound
from protocols.mission.document import Mission, MissionError
from protocols.mission.fault import Fault
from protocols.wire.sensed import MAX_OBSTACLES, empty_sensed
from protocols.wire.status import AgentStatus
from world import faults, field, referee, tick
from world import plant as physics
from world.digest import Digests
from world.medium import information_bound as information_bound
from world.medium import medium
from world.order import any_order
from world.outcome import Judgement, Outcome, StruckOff


class Answers(NamedTuple):
    """What the drones of E worlds answer to one tick, row by row.

    command: (E*N, 2) acceleration [m/s^2]. sent_bytes: (E*N,) size of the frame each sent, 0 for none. claim: (E*N,) the slot
    each says it holds. accounts: what some tell of themselves, with their rows. Rows that are not awake count for nothing.
    """

    command: NDArray[np.float64]
    sent_bytes: NDArray[np.int64]
    claim: NDArray[np.int64]
    accounts: Sequence[tuple[int, AgentStatus]] = ()


class Inbox(NamedTuple):
    """Frames that arrive now: row r hears ``arrived[start[r]:start[r + 1]]``, each (source row, tick of sending)."""

    start: NDArray[np.int64]
    arrived: NDArray[np.int32]


class WorldCore:
    """The state of E worlds of N drones and the rules that move it.

    active: (E,) worlds in which is flown. decided: (E,) those whose flight is decided; they are flown on only while the other of
    the two successes is open (world.outcome). counted: (E, ...) their tally at the decision.
    """

    def __init__(self, missions: Sequence[Mission], watched: bool = False, both: bool = True) -> None:
        """Lay out the fields of ``missions``, which must agree in all but seeds and faults.

        Args:
            watched: somebody looks on, wants to see what becomes of frames (`fates`), and may lay hands on a flight.
            both: fly on until both successes are judged; else a flight is over as soon as it is decided.

        Raises:
            world.field.FieldError: a mission leaves no room to start.
        """
        first = missions[0]
        self.missions = tuple(missions)
        self.layout = first.layout
        worlds, agents = len(missions), first.agents
        self.shape = (worlds, agents)
        self.tick = np.zeros(worlds, np.int64)
        self.active = np.ones(worlds, np.bool_)
        self.condition = faults.sound(self.missions)
        self.flying, self.responsive = self.condition.flying, self.condition.responsive
        self.position = np.zeros((*self.shape, 2))
        self.velocity = np.zeros((*self.shape, 2))
        self.command = np.zeros((*self.shape, 2))
        self.claim = np.zeros(self.shape, np.int16)
        self.target = np.zeros(worlds)
        self.obstacle_count = np.zeros(worlds, np.int64)
        self.obstacles = np.zeros((worlds, MAX_OBSTACLES, 3))
        self.goal_x = np.zeros(worlds)
        for world, mission in enumerate(missions):
            discs = field.draw_obstacles(mission)
            self.obstacle_count[world] = len(discs)
            self.obstacles[world, : len(discs)] = discs
            self.goal_x[world] = field.goal_x(mission, discs)
            self.position[world] = field.draw_start(mission, discs)
            self.claim[world] = field.draw_slots(mission)
        self.initial_slots = self.claim.copy()
        self.sensed = empty_sensed(worlds * agents)
        self._findings = referee.empty_findings(worlds, agents)
        self.nearest, self.edge_error = self._findings.nearest, self._findings.edge_error
        self.tally = np.zeros((worlds, len(medium.TALLY)), np.int64)
        link = medium.link_of(first)
        queue = medium.empty_queue(worlds, agents, link.longest)
        self._sizes = np.zeros((worlds, link.longest + 1, agents), np.int64)
        seen = agents if watched else 0
        self.fates = np.full((worlds, seen, seen, len(medium.FATES)), medium.LONG_AGO, np.int32)
        self.inbox_start = np.zeros(worlds * agents + 1, np.int64)
        self.inbox = np.zeros((worlds * queue.entry.shape[2], 2), np.int32)
        # Only where something goes wrong, or may, is there news to wait for.
        self._bound = information_bound.empty_information_bound(
            worlds if watched or any(mission.faults for mission in missions) else 0, agents, self.ring
        )
        limits, layout, by_x = first.limits, self.layout, any_order(worlds, agents)
        self._stage = by_reference(
            tick.Stage(
                medium.Clocks(
                    np.array([mission.seed for mission in missions], np.int64), self.tick, self.active
                ),
                self.responsive,
                np.zeros(self.shape, np.bool_),
                self.claim,
                self.target,
                first.target.speed_mps,
                physics.Bodies(
                    self.flying, self.position, self.velocity, self.command, self.condition.ability, by_x
                ),
                physics.Ground(self.goal_x, self.obstacle_count, self.obstacles),
                limits.acceleration_mps2,
                limits.speed_mps,
                first.sensing.range_m,
                first.sensing.neighbours == "sensed",
                self.sensed,
                link,
                medium.Air(
                    self.flying, self.condition.group, self.condition.loss, self.position,
                    np.zeros(self.shape, np.int64), self.fates, by_x,
                ),
                np.zeros((worlds, agents, agents), np.bool_),
                queue,
                self.tally,
                self._sizes,
                self.inbox_start,
                self.inbox,
                referee.Standard(
                    layout.offsets, layout.parent, layout.spacing, first.edge_tolerance, limits.collision_m, True
                ),
                self._findings,
                self._bound,
            )
        )  # fmt: skip
        self._perceive, self._advance = bound(tick.perceive, self._stage), rebound(tick.advance)
        self._judgements = [Judgement(mission, both) for mission in missions]
        self._digests = Digests((self.position, self.velocity, self.flying, self.claim, self.tally))
        self._position_in = list(self.position)  # NumPy's own indexing costs more than the rules
        self._eventful = {fault.at_tick for mission in missions for fault in mission.faults}
        self.decided = np.zeros(worlds, np.bool_)
        self.counted, self._left = self.tally.copy(), self.flying.copy()  # when that was
        self.outcomes: list[Outcome | None] = [None] * worlds
        self.struck_off: list[list[StruckOff]] = [[] for _ in missions]
        self.by_hand: list[list[Fault]] = [[] for _ in missions]
        self._barred = np.zeros(self.shape, np.bool_)  # struck off: no fault of the mission brings them back

    @property
    def ring(self) -> int:
        """A frame can still arrive this many ticks after it was sent; keep at least as many ticks of frames."""
        return self._sizes.shape[1]

    @property
    def inbox_size(self) -> int:
        """No more frames than this arrive in one tick."""
        return len(self.inbox)

    @property
    def rows_awake(self) -> NDArray[np.bool_]:
        """(E*N,) the drones that sense, hear and answer this tick."""
        return (self.responsive & self.flying & self.active[:, None]).ravel()

    def lay_hand(self, world: int, fields: Mapping[str, Any]) -> None:
        """Let a fault happen at the beginning of the coming tick that the mission did not foresee; from then on it is the
        mission's. ``fields``: of a fault, without its time.

        Raises:
            protocols.mission.document.MissionError: it would have no effect, or there is no such fault.
        """
        if self.decided[world]:
            raise MissionError("by hand: the flight is decided, and no fault counts any more")
        at_s = round(int(self.tick[world]) * TICK_S, 2)
        mission = faults.with_fault(self.missions[world], {"at_s": at_s, **fields})
        self.missions = (*self.missions[:world], mission, *self.missions[world + 1 :])
        self.by_hand[world].append(mission.faults[-1])
        self._eventful.add(mission.faults[-1].at_tick)

    def begin_tick(self) -> list[faults.Event]:
        """Let the faults due now happen, and say which they were."""
        if int(self.tick.max()) not in self._eventful:  # which all active worlds are at
            return []
        going_on = self.active & ~self.decided
        events = faults.due(self.missions, self.initial_slots, going_on, self.tick, self._barred)
        for event in events:
            agents = list(event.agents)
            faults.strike(event, self.condition, self.velocity, self.command)
            if event.fault.kind == "kill":
                self._fell(event.world, agents)
            elif event.fault.kind == "restart":
                self._bound.latest[event.world, agents] = information_bound.NEVER
        return events

    def _fell(self, world: int, agents: list[int]) -> None:
        """They are out of the air: near nobody, off nothing."""
        self.nearest[world, agents] = np.inf
        self.edge_error[world, agents] = 0.0

    def strike_off(self, world: int, agent: int, why: str) -> bool:
        """Take a drone out of the air for good, without the mission's doing; False if it flies no more."""
        if not self.flying[world, agent]:
            return False
        if not self.decided[world]:
            self.struck_off[world].append(StruckOff(agent, round(int(self.tick[world]) * TICK_S, 2), why))
        self.land(world, agent)
        return True

    def land(self, world: int, agent: int) -> None:
        """Take a drone, one that its failsafe lands say, out of the air for good."""
        self.flying[world, agent] = self.responsive[world, agent] = False
        self._barred[world, agent] = True
        self._fell(world, [agent])

    def perceive(self) -> Inbox:
        """Fill ``sensed`` with what every flying drone of an active world senses now; return what they hear."""
        total = self._perceive()
        return Inbox(self.inbox_start, self.inbox[:total])

    def could_know(self, world: int) -> NDArray[np.int32] | None:
        """(N, N): of which tick of drone j (column) drone i could know by now; None in a mission without faults."""
        return self._bound.latest[world] if len(self._bound.latest) else None

    def advance(self, answers: Answers, agreed: Sequence[bool] | None = None) -> list[int]:
        """Move all worlds by one tick; return those whose flight has just ended. ``agreed``: (E,) whether all living drones have
        one view of the slots; None: they do."""
        self._advance(answers.command, answers.sent_bytes, answers.claim, self._stage)
        return self._settle(agreed or [True] * len(self.missions))

    def _settle(self, agreed: Sequence[bool]) -> list[int]:
        ended: list[int] = []
        verdicts, ticks = (
            self._findings.verdict.tolist(),
            self.tick.tolist(),
        )  # NumPy's own cost more than the rules
        self._digests.take()
        for world in np.flatnonzero(self.active).tolist():
            judgement = self._judgements[world]
            verdict = referee.Verdict._make(verdicts[world])
            judgement.settle(ticks[world], verdict, self._position_in[world], agreed[world])
            if judgement.decision is not None and not self.decided[world]:
                self._decide(world, judgement.decision)
            if judgement.over:
                self.end(world, str(judgement.decision))
                ended.append(world)
        return ended

    def _decide(self, world: int, decision: str) -> None:
        """What is so now is how the flight ended, whatever comes after."""
        self.decided[world] = True
        self._digests.close(world)
        self.counted[world], self._left[world] = self.tally[world], self.flying[world]
        self.outcomes[world] = self._settled(world, decision)

    def end(self, world: int, failure: str) -> None:
        """End a flight; from outside, for example when it was interrupted or nobody is left. What was decided before stays so."""
        self.active[world] = False
        if not self.decided[world]:
            self._decide(world, failure)
        self.outcomes[world] = self._settled(world, failure)

    def outcome(self, world: int) -> Outcome:
        """How a flight ended, or would have if it were interrupted now."""
        return self.outcomes[world] or self._settled(world, "interrupted")

    def _settled(self, world: int, failure: str) -> Outcome:
        flying = self._left if self.decided[world] else self.flying
        tick, digest = int(self.tick[world]), self._digests.of(world)
        return self._judgements[world].outcome(tick, failure, flying[world], digest)
