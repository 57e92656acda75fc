"""The order of a tick, in one place, for every way to fly: in real processes, in one, or many worlds at once.

    faults     what the mission says goes wrong happens to the drones, and to their processes
    perceive   what is sensed, and the frames that arrive
    ask        every drone that is awake decides
    watch      the invariants of the slots, over the drones' accounts; whose account is impossible is struck off
    advance    move, relay, judge
    end        flights in which nobody is left

Where the drones are is behind the port `Swarm`.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import TICK_S
from protocols.kernels import bound, by_reference, rebound
from protocols.wire.frames import MAX_FRAME_BYTES
from protocols.wire.status import AgentStatus
from world.core import Answers, Inbox, WorldCore
from world.failsafe import CommandAges
from world.faults import Event
from world.glance import OTHERS_AWAKE, WRONG_CLAIM, Watch, glance, is_deserted
from world.invariants import Discredited, Invariants, Watched
from world.medium.medium import TALLY
from world.outcome import Flown, Outcome, as_broken


class Swarm(Protocol):
    """The drones of all worlds, wherever they live."""

    def strike(self, event: Event) -> None:
        """Do to the drones' processes, or to what stands for them, what this fault says."""

    def ask(self, tick: int, inbox: Inbox) -> Answers | None:
        """What the drones that are awake answer to what they sense and hear; None to leave the flight before this tick."""

    def struck_off(self, row: int) -> None:
        """This drone flies no more, without the mission's doing."""

    def farewell(self) -> list[tuple[int, AgentStatus]]:
        """The last accounts of the drones that are awake, with their rows."""

    def plans(self, world: int) -> NDArray[np.float32] | None:
        """Where the drones of this world plan to be, (N, P, 2) m, NaN where one plans nothing; None if nobody tells."""
        return None


class Director:
    """Flies the worlds of ``core`` with ``swarm``, tick by tick.

    Attributes:
        invariants: what is watched, per world. statuses: the last account of each row that gave one. clock: ticks flown.
    """

    def __init__(self, core: WorldCore, swarm: Swarm) -> None:
        self.core, self._swarm = core, swarm
        cooldown_s = core.missions[0].swap.cooldown_s
        self.invariants = [Invariants(slots, cooldown_s) for slots in core.initial_slots]
        # Looked at for all worlds at once, which costs what one would: what all drones told of their slots, and who was awake.
        self._says = np.stack([watch.says for watch in self.invariants])
        for watch, says in zip(self.invariants, self._says, strict=True):
            watch.says = says
        self._awake, self._living = np.zeros(core.shape, np.bool_), [list[int]() for _ in core.missions]
        self.statuses: dict[int, AgentStatus] = {}
        self.clock = 0
        # Frames of each size, per world; 0 counts those who sent nothing.
        self._sizes = np.zeros((core.shape[0], MAX_FRAME_BYTES + 2), np.int64)
        self._watched = by_reference(
            Watch(core.active, core.flying, core.responsive, self._says, self._awake, self._sizes)
        )
        self._glance, self._is_deserted = rebound(glance), bound(is_deserted, self._watched)
        # Sizes, and what was watched, when it was decided.
        self._seen: dict[int, tuple[np.ndarray, Watched]] = {}

    def tick(self) -> list[int]:
        """Fly one tick in every active world; return the worlds whose flight has just ended."""
        core = self.core
        for event in core.begin_tick():
            self.invariants[event.world].fault(self.clock)
            if event.fault.kind == "restart":
                for agent in event.agents:
                    self.invariants[event.world].renew(agent)
            self._swarm.strike(event)
        inbox = core.perceive()
        answers = self._swarm.ask(self.clock, inbox)
        if answers is None:
            return self.leave()
        self._watch(answers)
        ended = core.advance(answers, [watch.one_view for watch in self.invariants])
        self.clock += 1
        ended += self._end()
        for world in np.flatnonzero(core.decided).tolist():
            if world not in self._seen:
                self._seen[world] = self._sizes[world].copy(), self.invariants[world].result()
        return self._close(ended)

    def plans(self, world: int = 0) -> NDArray[np.float32] | None:
        """As `Swarm.plans`."""
        return self._swarm.plans(world)

    def strike_off(self, row: int, why: str) -> None:
        """Take the drone of this row out of its flight without the mission's doing, and let the others fly on."""
        world, agent = divmod(row, self.core.shape[1])
        if self.core.strike_off(world, agent, why):
            self.invariants[world].lose(agent)
            self._swarm.struck_off(row)

    def leave(self) -> list[int]:
        """End all flights as interrupted; return which they were."""
        worlds: list[int] = np.flatnonzero(self.core.active).tolist()
        for world in worlds:
            self.core.end(world, "interrupted")
        return self._close(worlds)

    def _watch(self, answers: Answers) -> None:
        core, agents = self.core, self.core.shape[1]
        for row, status in answers.accounts:
            world, agent = divmod(row, agents)
            if not core.flying[world, agent]:
                continue
            discredited = self.invariants[world].see(self.clock, agent, status)
            if agent not in dict(discredited):
                self.statuses[row] = status
            self._discredit(world, discredited)
        seen = self._glance(answers.sent_bytes, answers.claim, self._watched)
        if seen & OTHERS_AWAKE:
            self._living = [np.flatnonzero(world).tolist() for world in self._awake]
        for world in np.flatnonzero(core.active).tolist():
            watch = self.invariants[world]
            if seen & WRONG_CLAIM:
                claims = answers.claim.reshape(core.shape)[world]
                self._discredit(world, watch.claims(self.clock, claims, core.flying[world]))
            watch.tick(self.clock, self._living[world], core.could_know(world))

    def _discredit(self, world: int, discredited: Discredited) -> None:
        for agent, why in discredited:
            self.strike_off(world * self.core.shape[1] + agent, why)

    def _end(self) -> list[int]:
        if not self._is_deserted():
            return []
        ended: list[int] = np.flatnonzero(self.core.active & ~self.core.flying.any(axis=1)).tolist()
        for world in ended:
            self.core.end(world, "all-lost")
        return ended

    def _close(self, ended: list[int]) -> list[int]:
        for world in ended:
            self.core.outcomes[world] = self._outcome(world)
        return ended

    def _outcome(self, world: int) -> Outcome:
        """How a flight ended, or would have if it were interrupted now, with what broke it."""
        outcome = self.core.outcome(world)
        if outcome.failure == "broken":
            return outcome
        return as_broken(outcome, tuple(self.core.struck_off[world]), self.watched(world).breach)

    def watched(self, world: int) -> Watched:
        """What was seen of the slots in this flight."""
        return self._seen[world][1] if world in self._seen else self.invariants[world].result()

    def flown(
        self,
        wall_s: float,
        first_tick_at: float,
        message_bytes: tuple[float, float] = (0.0, 0.0),
        world: int = 0,
        command_ages: CommandAges | None = None,
    ) -> Flown:
        """What came of the flight in this world. When it is over its drones are asked for their last accounts."""
        outcome = self._outcome(world)
        agents = self.core.shape[1]
        rows = range(world * agents, (world + 1) * agents)
        decided = world in self._seen
        counted = self.core.counted if decided else self.core.tally
        if not self.core.active[world]:
            last = (farewell for farewell in self._swarm.farewell() if farewell[0] in rows)
            possible = self.invariants[world].may_be
            self.statuses.update(
                (row, status) for row, status in last if possible(self.clock, row - rows.start, status)
            )
        return Flown(
            outcome=outcome,
            tally=dict(zip(TALLY, counted[world].tolist(), strict=True)),
            statuses={row - rows.start: self.statuses[row] for row in rows if row in self.statuses},
            watched=self.watched(world),
            wall_s=wall_s,
            real_time_factor=outcome.ticks * TICK_S / max(wall_s, 1e-9),
            command_ages=command_ages,
            median_frame_bytes=_median(self._seen[world][0] if decided else self._sizes[world]),
            message_bytes=message_bytes,
            first_tick_at=first_tick_at,
            by_hand=tuple(self.core.by_hand[world]),
        )


def _median(counts: np.ndarray) -> float:
    """The lower median of sizes given as counts per size; size 0 means that nothing was sent."""
    counts = counts.copy()
    counts[0] = 0
    total = int(counts.sum())
    return float(np.searchsorted(np.cumsum(counts), (total + 1) // 2)) if total else 0.0
