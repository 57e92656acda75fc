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

from protocols.dynamics import TICK_S, target_x
from protocols.kernels import by_reference, inlined_kernel, kernel
from protocols.mission.document import Mission
from protocols.mission.fault import Fault
from protocols.wire.sensed import MAX_OBSTACLES, Sensed, empty_sensed
from protocols.wire.status import AgentStatus
from world import faults, field, referee
from world import plant as physics
from world.medium import information_bound as information_bound
from world.medium import medium
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


class _Stage(NamedTuple):
    """Everything that the rules of a tick work on, of E worlds.

    responsive, hears: (E, N) who answers; whose radio is on now. claim: (E, N) slots. target: (E,) x of the virtual target [m],
    target_mps its speed. acceleration_mps2, speed_mps: the limits of all drones. reach_m: of their sensors. sizes: (E, D, N)
    bytes of the frames sent, by tick % D. bound: of no worlds where nothing can go wrong. The rest as its class says, and as
    `medium.relay` and `medium.deliver` do.
    """

    clocks: medium.Clocks
    responsive: NDArray[np.bool_]
    hears: NDArray[np.bool_]
    claim: NDArray[np.int16]
    target: NDArray[np.float64]
    target_mps: float
    bodies: physics.Bodies
    ground: physics.Ground
    acceleration_mps2: float
    speed_mps: float
    reach_m: float
    neighbours_sensed: bool
    sensed: Sensed
    link: medium.Link
    air: medium.Air
    bad: NDArray[np.bool_]
    queue: medium.Queue
    tally: NDArray[np.int64]
    sizes: NDArray[np.int64]
    inbox_start: NDArray[np.int64]
    inbox: NDArray[np.int32]
    standard: referee.Standard
    findings: referee.Findings
    bound: information_bound.InformationBound


@kernel
def _perceive(stage: _Stage) -> int:
    """Let all sense and hear; return how many frames arrive."""
    active, bodies, hears = stage.clocks.active, stage.bodies, stage.hears
    physics.sense(active, bodies, stage.ground, stage.reach_m, stage.neighbours_sensed, stage.sensed)
    for world in range(hears.shape[0]):
        for agent in range(hears.shape[1]):
            hears[world, agent] = stage.responsive[world, agent] and bodies.flying[world, agent]
    start, inbox = stage.inbox_start, stage.inbox
    total = medium.deliver(
        stage.clocks.ticks, active, hears, stage.sizes, stage.queue, stage.tally, start, inbox
    )
    if stage.bound.latest.shape[0] > 0:
        information_bound.spread(stage.bound, stage.clocks.ticks, active, start, inbox)
    return total


@kernel
def _advance(
    command: NDArray[np.float64], sent_bytes: NDArray[np.int64], claim: NDArray[np.int64], stage: _Stage
) -> None:
    """Take the answers, relay what was said, move, go on to the next tick, and judge."""
    clocks, bodies = stage.clocks, stage.bodies
    _take_answers(command, sent_bytes, claim, stage)
    medium.relay(stage.link, clocks, stage.air, stage.bad, stage.queue, stage.tally)
    physics.move(clocks.active, bodies, stage.acceleration_mps2, stage.speed_mps, TICK_S)
    for world in range(clocks.active.shape[0]):
        if clocks.active[world]:
            clocks.ticks[world] += 1
            stage.target[world] = target_x(clocks.ticks[world], stage.target_mps)
    referee.judge(
        clocks.active, bodies, stage.claim, stage.ground, stage.target, stage.standard, stage.findings
    )


@inlined_kernel
def _take_answers(
    command: NDArray[np.float64], sent_bytes: NDArray[np.int64], claim: NDArray[np.int64], stage: _Stage
) -> None:
    """Take over, from rows, what those said that are awake; the others' commands and claims stay, and they sent nothing."""
    flying, commands, sent, sizes = (
        stage.bodies.flying,
        stage.bodies.command,
        stage.air.sent_bytes,
        stage.sizes,
    )
    worlds, agents = flying.shape
    for world in range(worlds):
        bucket = stage.clocks.ticks[world] % sizes.shape[1]
        for agent in range(agents):
            row = world * agents + agent
            awake = stage.responsive[world, agent] and flying[world, agent]
            sizes[world, bucket, agent] = sent[world, agent] = sent_bytes[row] if awake else 0
            if awake:
                commands[world, agent, 0], commands[world, agent, 1] = command[row, 0], command[row, 1]
                stage.claim[world, agent] = claim[row]


class WorldCore:
    """The state of E worlds of N drones and the rules that move it."""

    def __init__(self, missions: Sequence[Mission], watched: bool = False) -> None:
        """Lay out the fields of ``missions``, which must agree in all but seeds and faults.

        Args:
            watched: somebody looks on, wants to see what becomes of frames (`fates`), and may lay hands on a flight.

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
        limits, layout = first.limits, self.layout
        self._stage = by_reference(
            _Stage(
                medium.Clocks(
                    np.array([mission.seed for mission in missions], np.int64), self.tick, self.active
                ),
                self.responsive,
                np.zeros(self.shape, np.bool_),
                self.claim,
                self.target,
                first.target.speed_mps,
                physics.Bodies(
                    self.flying, self.position, self.velocity, self.command, self.condition.ability
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
                    np.zeros(self.shape, np.int64), self.fates,
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
        self._judgements = [Judgement(mission) for mission in missions]
        # What a digest is of, world by world: NumPy's own indexing cost more than the hash.
        digested = (self.position, self.velocity, self.flying, self.claim, self.tally)
        self._digested = [tuple(array[world] for array in digested) for world in range(worlds)]
        self._eventful = {fault.at_tick for mission in missions for fault in mission.faults}
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
        at_s = round(int(self.tick[world]) * TICK_S, 2)
        mission = faults.with_fault(self.missions[world], {"at_s": at_s, **fields})
        self.missions = (*self.missions[:world], mission, *self.missions[world + 1 :])
        self.by_hand[world].append(mission.faults[-1])
        self._eventful.add(mission.faults[-1].at_tick)

    def begin_tick(self) -> list[faults.Event]:
        """Let the faults due now happen, and say which they were."""
        if int(self.tick.max()) not in self._eventful:  # which all active worlds are at
            return []
        events = faults.due(self.missions, self.initial_slots, self.active, self.tick, self._barred)
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
        total = _perceive(self._stage)
        return Inbox(self.inbox_start, self.inbox[:total])

    def could_know(self, world: int) -> NDArray[np.int32] | None:
        """(N, N): of which tick of drone j (column) drone i could know by now; None in a mission without faults."""
        return self._bound.latest[world] if len(self._bound.latest) else None

    def advance(self, answers: Answers) -> list[int]:
        """Move all worlds by one tick; return those whose flight has just ended."""
        _advance(answers.command, answers.sent_bytes, answers.claim, self._stage)
        return self._settle()

    def _settle(self) -> list[int]:
        ended: list[int] = []
        verdicts, ticks = (
            self._findings.verdict.tolist(),
            self.tick.tolist(),
        )  # NumPy's own cost more than the rules
        for world in np.flatnonzero(self.active).tolist():
            judgement, state = self._judgements[world], self._digested[world]
            judgement.digest(state)
            verdict = referee.Verdict._make(verdicts[world])
            end = judgement.settle(ticks[world], verdict, state[0])
            if end is not None:
                self.end(world, end)
                ended.append(world)
        return ended

    def end(self, world: int, failure: str) -> None:
        """End a flight; from outside, for example when it was interrupted or nobody is left."""
        self.active[world] = False
        self.outcomes[world] = self._settled(world, failure)

    def outcome(self, world: int) -> Outcome:
        """How a flight ended, or would have if it were interrupted now."""
        return self.outcomes[world] or self._settled(world, "interrupted")

    def _settled(self, world: int, failure: str) -> Outcome:
        return self._judgements[world].outcome(int(self.tick[world]), failure, self.flying[world])
