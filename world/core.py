"""WorldCore: one tick of nature for E worlds at once, without IO.

A flight in real processes is one world (E = 1); a batch flies many worlds of the same size and rules that differ in their
seeds. Each tick the shell around it calls, in this order,

    begin_tick   apply what the mission says goes wrong now (the shell then kills, freezes or restarts processes)
    sense        what every drone's sensors see
    deliver      the frames that arrive now
    advance      the drones' commands and frames: move, relay, judge

Row r of every per-drone array is agent r % N of world r // N.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import TICK_S, target_x
from protocols.kernels import kernel
from protocols.mission.document import Fault, Mission
from protocols.wire.sensed import MAX_OBSTACLES, Sensed, empty_sensed
from world import field, referee
from world import plant as physics
from world.medium import information_bound as information_bound
from world.medium import medium

EVERYONE = 0  # radio group while the swarm is not parted


@dataclass(frozen=True)
class Outcome:
    """How one flight ended. Distances in metres, times in seconds, errors relative to the edge length.

    formed_s: when the formation first stood, wherever that was; tau_s: when it stood beyond the goal line.
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


@dataclass(frozen=True)
class Event:
    """A fault that has just been applied, with the agents it names."""

    world: int
    fault: Fault
    agents: tuple[int, ...]


@kernel
def _take_answers(
    tick: NDArray[np.int64],
    responsive: NDArray[np.bool_],
    flying: NDArray[np.bool_],
    command: NDArray[np.float64],
    sent_bytes: NDArray[np.int64],
    claim: NDArray[np.int64],
    commands: NDArray[np.float64],
    sent: NDArray[np.int64],
    sizes: NDArray[np.int64],
    claims: NDArray[np.int16],
) -> None:
    """Take over, from rows, what those said that are awake; the others' commands and claims stay, and they sent nothing."""
    worlds, agents = flying.shape
    for world in range(worlds):
        bucket = tick[world] % sizes.shape[1]
        for agent in range(agents):
            row = world * agents + agent
            awake = responsive[world, agent] and flying[world, agent]
            sizes[world, bucket, agent] = sent[world, agent] = sent_bytes[row] if awake else 0
            if awake:
                commands[world, agent, 0], commands[world, agent, 1] = command[row, 0], command[row, 1]
                claims[world, agent] = claim[row]


@kernel
def _next_tick(
    active: NDArray[np.bool_], tick: NDArray[np.int64], target: NDArray[np.float64], target_mps: float
) -> None:
    """Move the clock and the virtual target on, in every active world."""
    for world in range(active.shape[0]):
        if active[world]:
            tick[world] += 1
            target[world] = target_x(tick[world], target_mps)


class WorldCore:
    """The state of E worlds of N drones and the rules that move it."""

    def __init__(self, missions: Sequence[Mission]) -> None:
        """Lay out the fields of ``missions``, which must agree in all but seeds and faults.

        Raises:
            world.field.FieldError: a mission leaves no room to start.
        """
        first = missions[0]
        self.missions = tuple(missions)
        self.plan = first.plan
        worlds, agents = len(missions), first.agents
        self.shape = (worlds, agents)
        self.tick = np.zeros(worlds, np.int64)
        self.active = np.ones(worlds, np.bool_)
        self.flying = np.ones(self.shape, np.bool_)
        self.responsive = np.ones(self.shape, np.bool_)
        self.position = np.zeros((*self.shape, 2))
        self.velocity = np.zeros((*self.shape, 2))
        self.command = np.zeros((*self.shape, 2))
        self.ability = np.ones(self.shape)
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
        self.nearest = np.full(self.shape, np.inf)
        self.edge_error = np.zeros(self.shape)
        self.verdict = np.zeros((worlds, referee.VERDICT_SIZE))
        self.tally = np.zeros((worlds, len(medium.TALLY)), np.int64)
        self._link = medium.link_of(first)
        self._seeds = np.array([mission.seed for mission in missions], np.int64)
        self._group = np.full(self.shape, EVERYONE, np.int16)
        self._bad = np.zeros((worlds, agents, agents), np.bool_)
        self._queue = medium.empty_queue(worlds, agents, self._link.longest)
        self._sizes = np.zeros((worlds, self._link.longest + 1, agents), np.int64)
        self._sent = np.zeros(self.shape, np.int64)
        self._inbox_start = np.zeros(worlds * agents + 1, np.int64)
        self._inbox = np.zeros((worlds * self._queue.entry.shape[2], 2), np.int32)
        # Only where something goes wrong is there news to wait for.
        self._information_bound = (
            information_bound.empty_information_bound(worlds, agents, self.ring) if first.faults else None
        )
        self._is_leaf = self.plan.is_leaf
        self._closest = np.full(worlds, np.inf)
        self._closest_text = ["nobody came near anybody"] * worlds
        self._overlap_ticks = np.zeros(worlds)
        self._formed_tick = np.full(worlds, -1, np.int64)
        self._tau_tick = np.full(worlds, -1, np.int64)
        self._at_tau = np.zeros((worlds, referee.VERDICT_SIZE))
        self._held = np.ones(worlds, np.bool_)
        self._hashes = [hashlib.blake2b(digest_size=16) for _ in missions]
        self.outcomes: list[Outcome | None] = [None] * worlds

    @property
    def ring(self) -> int:
        """A frame can still arrive this many ticks after it was sent; keep at least as many ticks of frames."""
        return self._sizes.shape[1]

    @property
    def inbox_size(self) -> int:
        """No more frames than this arrive in one tick."""
        return len(self._inbox)

    @property
    def rows_awake(self) -> NDArray[np.bool_]:
        """(E*N,) the drones that sense, hear and answer this tick."""
        return (self.responsive & self.flying & self.active[:, None]).ravel()

    def begin_tick(self) -> list[Event]:
        """Apply the faults due now and say which they were."""
        events = []
        for world in np.flatnonzero(self.active).tolist():
            for fault in self.missions[world].faults:
                if fault.at_tick == self.tick[world]:
                    by_slot = (
                        int(np.flatnonzero(self.initial_slots[world] == slot)[0]) for slot in fault.slots
                    )
                    event = Event(int(world), fault, (*fault.agents, *by_slot))
                    self._apply(event)
                    events.append(event)
        return events

    def _apply(self, event: Event) -> None:
        world, agents, kind = event.world, list(event.agents), event.fault.kind
        if kind == "kill":
            self.lose(world, agents)
        elif kind == "freeze":
            self.responsive[world, agents] = False
            self.command[world, agents] = 0.0
        elif kind == "thaw":
            self.responsive[world, agents] = self.flying[world, agents]  # no thaw revives the dead
        elif kind == "restart":
            if self._information_bound:
                self._information_bound.latest[world, agents] = information_bound.NEVER
            self.responsive[world, agents] = True
            self.velocity[world, agents] *= self.flying[world, agents, None]
            self.flying[world, agents] = True
        elif kind == "slow":
            self.ability[world, agents] = event.fault.factor
        elif kind == "recover":
            self.ability[world, agents] = 1.0
        elif kind == "heal":
            self._group[world] = EVERYONE
        elif kind == "part":
            self._group[world] = EVERYONE
            for number, group in enumerate(event.fault.groups, start=1):
                self._group[world, list(group)] = number

    def lose(self, world: int, agents: list[int]) -> None:
        """These drones fall out of the air for good (or until a restart): their process is gone."""
        self.flying[world, agents] = False
        self.responsive[world, agents] = False
        self.nearest[world, agents] = np.inf
        self.edge_error[world, agents] = 0.0

    def sense(self) -> Sensed:
        """What every flying drone of an active world senses now; the same arrays each tick."""
        mission = self.missions[0]
        physics.sense(
            self.active, self.flying, self.position, self.velocity, self.obstacle_count, self.obstacles,
            mission.sensing.range_m, mission.sensing.neighbours == "sensed", self.sensed,
        )  # fmt: skip
        return self.sensed

    def deliver(self) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
        """Frames that arrive now: row r hears ``arrived[start[r]:start[r + 1]]`` = (source row, tick of sending)."""
        hears = self.responsive & self.flying
        total = medium.deliver(
            self.tick,
            self.active,
            hears,
            self._sizes,
            self._queue,
            self.tally,
            self._inbox_start,
            self._inbox,
        )
        if self._information_bound:
            information_bound.spread(
                self._information_bound, self.tick, self.active, self._inbox_start, self._inbox
            )
        return self._inbox_start, self._inbox[:total]

    def could_know(self, world: int) -> NDArray[np.int32] | None:
        """(N, N): of which tick of drone j (column) drone i could know by now; None in a mission without faults."""
        return self._information_bound.latest[world] if self._information_bound else None

    def advance(
        self,
        command: NDArray[np.float64],
        sent_bytes: NDArray[np.int64],
        claim: NDArray[np.int64],
    ) -> list[int]:
        """Move all worlds by one tick; return those whose flight has just ended.

        Args:
            command: (E*N, 2) acceleration [m/s^2]; a drone that did not answer keeps its row's last value.
            sent_bytes: (E*N,) size of the frame each drone sent this tick, 0 for none.
            claim: (E*N,) the slot each drone says it holds.
        """
        mission, limits = self.missions[0], self.missions[0].limits
        _take_answers(
            self.tick,
            self.responsive,
            self.flying,
            command,
            sent_bytes,
            claim,
            self.command,
            self._sent,
            self._sizes,
            self.claim,
        )
        medium.relay(
            self._link, self._seeds, self.tick, self.active, self.flying, self._group, self.position, self._sent, self._bad,
            self._queue, self.tally,
        )  # fmt: skip
        physics.move(
            self.active, self.flying, self.position, self.velocity, self.command, self.ability, limits.acceleration_mps2,
            limits.speed_mps, TICK_S,
        )  # fmt: skip
        _next_tick(self.active, self.tick, self.target, mission.target.speed_mps)
        referee.judge(
            self.active, self.flying, self.position, self.claim, self.target, self.goal_x, self.obstacle_count, self.obstacles,
            self.plan.offsets, self.plan.parent, self._is_leaf, self.plan.spacing, mission.edge_tolerance, limits.collision_m,
            self.nearest, self.edge_error, self.verdict,
        )  # fmt: skip
        return self._settle()

    def _settle(self) -> list[int]:
        mission, hold_ticks = self.missions[0], round(self.missions[0].hold_s / TICK_S)
        ended: list[int] = []
        verdicts = self.verdict.tolist()  # a few numbers of each: NumPy's own cost more than the rules
        for world in np.flatnonzero(self.active).tolist():
            verdict, tick = verdicts[world], int(self.tick[world])
            self._hash(world)
            self._overlap_ticks[world] += verdict[referee.SHARED_SLOTS]
            closest = min(verdict[referee.CLOSEST_AGENTS], verdict[referee.CLOSEST_OBSTACLE])
            if closest < self._closest[world]:
                self._closest[world] = closest
                self._closest_text[world] = self._describe_closest(world)
            if self._formed_tick[world] < 0 and verdict[referee.STANDING] > 0:
                self._formed_tick[world] = tick
            formed = verdict[referee.FORMED] > 0
            if self._tau_tick[world] >= 0:
                self._held[world] &= formed
            elif formed:
                self._tau_tick[world] = tick
                self._at_tau[world] = verdict
            tau = int(self._tau_tick[world])
            failure = None
            if verdict[referee.COLLIDED] > 0:
                failure = "collision"
            elif tau < 0 and tick >= mission.ticks:
                failure = "late"
            if failure or 0 <= tau <= tick - hold_ticks:
                self.outcomes[world] = self._outcome(world, failure)
                self.active[world] = False
                ended.append(world)
        return ended

    def end(self, world: int, failure: str) -> Outcome:
        """End a flight from outside, for example when every process is gone or an invariant broke."""
        self.active[world] = False
        outcome = self.outcomes[world] = self._outcome(world, failure)
        return outcome

    def _hash(self, world: int) -> None:
        digest = self._hashes[world]
        digest.update(self.position[world])
        digest.update(self.velocity[world])
        digest.update(self.flying[world])
        digest.update(self.claim[world])
        digest.update(self.tally[world])

    def _describe_closest(self, world: int) -> str:
        verdict, at = self.verdict[world], f"{self.tick[world] * TICK_S:.2f} s"
        if verdict[referee.CLOSEST_AGENTS] <= verdict[referee.CLOSEST_OBSTACLE]:
            first, second = int(verdict[referee.AGENT_A]), int(verdict[referee.AGENT_B])
            x, y = (self.position[world, first] + self.position[world, second]) / 2
            who = f"agents {first} and {second}"
        else:
            agent = int(verdict[referee.AGENT_C])
            x, y = self.position[world, agent]
            who = f"agent {agent} and obstacle {int(verdict[referee.OBSTACLE])}"
        return f"{who} at x = {x:.1f} m, y = {y:.1f} m, t = {at}"

    def _outcome(self, world: int, failure: str | None) -> Outcome:
        tau, formed = int(self._tau_tick[world]), int(self._formed_tick[world])
        verdict = self._at_tau[world] if tau >= 0 else self.verdict[world]
        held_known = failure is None and self.missions[0].hold_s > 0
        return Outcome(
            success=failure is None,
            failure=failure,
            ticks=int(self.tick[world]),
            tau_s=round(tau * TICK_S, 2) if tau >= 0 else None,
            formed_s=round(formed * TICK_S, 2) if formed >= 0 else None,
            max_edge_error=float(verdict[referee.EDGE_ERROR]),
            max_slot_error_m=float(verdict[referee.SLOT_ERROR]),
            min_distance_m=float(self._closest[world]),
            closest=self._closest_text[world],
            held_after_success=bool(self._held[world]) if held_known else None,
            overlap_s=float(self._overlap_ticks[world]) * TICK_S,
            lost_agents=tuple(int(agent) for agent in np.flatnonzero(~self.flying[world])),
            digest=self._hashes[world].hexdigest(),
        )
