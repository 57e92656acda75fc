"""The order of a tick, in one place, for every way to fly: in real processes, in one, or many worlds at once.

    faults     what the mission says goes wrong happens to the drones, and to their processes
    perceive   what is sensed, and the frames that arrive
    ask        every drone that is awake decides
    watch      the invariants of the slots, over the drones' accounts
    advance    move, relay, judge
    end        flights whose invariants broke, or in which nobody is left

Where the drones are is behind the port `Swarm`.
"""

from typing import Protocol

import numpy as np

from protocols.dynamics import TICK_S
from protocols.wire.frames import MAX_FRAME_BYTES
from protocols.wire.status import AgentStatus
from world.core import Answers, Inbox, WorldCore
from world.faults import Event
from world.invariants import Invariants
from world.medium.medium import TALLY
from world.outcome import Flown


class Swarm(Protocol):
    """The drones of all worlds, wherever they live."""

    def strike(self, event: Event) -> None:
        """Do to the drones' processes, or to what stands for them, what this fault says."""

    def ask(self, tick: int, inbox: Inbox) -> Answers | None:
        """What the drones that are awake answer to what they sense and hear; None to leave the flight before this tick."""

    def farewell(self) -> list[tuple[int, AgentStatus]]:
        """The last accounts of the drones that are awake, with their rows."""


class Director:
    """Flies the worlds of ``core`` with ``swarm``, tick by tick.

    Attributes:
        invariants: what is watched, per world. statuses: the last account of each row that gave one. clock: ticks flown.
    """

    def __init__(self, core: WorldCore, swarm: Swarm) -> None:
        self.core, self._swarm = core, swarm
        cooldown_s = core.missions[0].swap.cooldown_s
        self.invariants = [Invariants(core.shape[1], cooldown_s) for _ in core.missions]
        self.statuses: dict[int, AgentStatus] = {}
        self.clock = 0
        self._sizes = np.zeros(
            MAX_FRAME_BYTES + 2, np.int64
        )  # frames of each size; 0 counts those who sent nothing

    def tick(self) -> list[int]:
        """Fly one tick in every active world; return the worlds whose flight has just ended."""
        core = self.core
        for event in core.begin_tick():
            self.invariants[event.world].fault(self.clock)
            self._swarm.strike(event)
        inbox = core.perceive()
        answers = self._swarm.ask(self.clock, inbox)
        if answers is None:
            return self.leave()
        self._watch(answers)
        sizes = np.minimum(answers.sent_bytes, len(self._sizes) - 1)
        self._sizes += np.bincount(sizes, minlength=len(self._sizes))
        ended = core.advance(answers)
        self.clock += 1
        return ended + self._end()

    def leave(self) -> list[int]:
        """End all flights as interrupted; return which they were."""
        worlds: list[int] = np.flatnonzero(self.core.active).tolist()
        for world in worlds:
            self.core.end(world, "interrupted")
        return worlds

    def _watch(self, answers: Answers) -> None:
        core, agents = self.core, self.core.shape[1]
        for row, status in answers.accounts:
            self.statuses[row] = status
            self.invariants[row // agents].see(self.clock, row % agents, status)
        awake = core.rows_awake.reshape(core.shape)
        for world in np.flatnonzero(core.active).tolist():
            self.invariants[world].tick(
                self.clock, np.flatnonzero(awake[world]).tolist(), core.could_know(world)
            )

    def _end(self) -> list[int]:
        core, ended = self.core, []
        for world in np.flatnonzero(core.active).tolist():
            if self.invariants[world].breach:
                core.end(world, "broken-invariant")
            elif not core.flying[world].any():
                core.end(world, "all-lost")
            else:
                continue
            ended.append(world)
        return ended

    def flown(
        self,
        wall_s: float,
        first_tick_at: float,
        deadline_misses: int = 0,
        message_bytes: tuple[float, float] = (0.0, 0.0),
    ) -> Flown:
        """What came of the flight in world 0. When it is over the drones are asked for their last accounts."""
        outcome = self.core.outcome(0)
        if not self.core.active[0]:
            self.statuses.update(self._swarm.farewell())
        return Flown(
            outcome=outcome,
            tally=dict(zip(TALLY, self.core.tally[0].tolist(), strict=True)),
            statuses={row: self.statuses[row] for row in sorted(self.statuses) if row < self.core.shape[1]},
            watched=self.invariants[0].result(),
            wall_s=wall_s,
            real_time_factor=outcome.ticks * TICK_S / max(wall_s, 1e-9),
            deadline_misses=deadline_misses,
            median_frame_bytes=_median(self._sizes),
            message_bytes=message_bytes,
            first_tick_at=first_tick_at,
        )


def _median(counts: np.ndarray) -> float:
    """The lower median of sizes given as counts per size; size 0 means that nothing was sent."""
    counts = counts.copy()
    counts[0] = 0
    total = int(counts.sum())
    return float(np.searchsorted(np.cumsum(counts), (total + 1) // 2)) if total else 0.0
