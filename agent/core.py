"""AgentCore: one tick of one or more drones, without IO.

A drone's process hosts one row, the in-process simulation all N drones, a batch all drones of all its worlds; the code is
the same. Each tick, for every awake row:

    perceive   sensors and heard frames -> neighbours, relative positions, obstacles, who is silent
    slots      hear the neighbours' slot notes; propose a swap or take a dead leader's slot where the trigger asks for it
    aim        slot -> targets; the observation X_i
    policy     -> wanted acceleration
    filter     -> safe acceleration: the command
    compose    the broadcast frame, when one is due
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent import cycle
from agent.control.gains import SafetyLimits
from agent.memory import empty_memory, forget
from agent.parties import Parties
from agent.policy import Policy, Seen, find_policy
from protocols import trigger
from protocols.formation import NO_PARENT
from protocols.frames import OBSERVATION_SIZE, Frames
from protocols.mission import TICK_S, Mission
from protocols.sensed import Sensed
from protocols.status import SWAP_COUNTS, AgentStatus


def tree_depth(parent: NDArray[np.int16]) -> NDArray[np.int64]:
    """(N,) edges from each slot up to the root."""
    depth = np.zeros(len(parent), np.int64)
    for slot in range(len(parent)):
        above = parent[slot]
        while above != NO_PARENT:
            depth[slot] += 1
            above = parent[above]
    return depth


class _Constants(NamedTuple):
    """What a mission means in ticks and numbers."""

    by_sensor: bool
    chain: bool
    rule: int
    memory_ticks: int
    silent_ticks: int
    frame_every: int
    depth: NDArray[np.int64]
    limits: SafetyLimits

    @staticmethod
    def of(mission: Mission) -> "_Constants":
        return _Constants(
            by_sensor=mission.sensing.neighbours == "sensed",
            chain=mission.aim == "chain",
            rule=trigger.RULES[mission.swap.rule],
            memory_ticks=round(mission.radio.memory_s / TICK_S),
            silent_ticks=round(mission.swap.silent_s / TICK_S),
            frame_every=mission.frame_every,
            depth=tree_depth(mission.plan.parent),
            limits=SafetyLimits(max_acceleration=mission.limits.acceleration_mps2),
        )


@dataclass(frozen=True, slots=True)
class Step:
    """What the hosted drones do this tick. Rows of sleeping drones are meaningless.

    command: (A, 2) acceleration [m/s^2]. slot: (A,) the slot each believes to hold. sent: (A,) whether a frame was
    composed, in row first + r of the frames given.
    """

    command: NDArray[np.float64]
    slot: NDArray[np.int64]
    sent: NDArray[np.bool_]


class AgentCore:
    """A drones of swarms that fly the same mission (up to seeds)."""

    def __init__(
        self,
        mission: Mission,
        me: Sequence[int],
        initial_slots: NDArray[np.int16],
        boot: int = 0,
        policy: Policy | None = None,
    ) -> None:
        """Make the drones numbered ``me`` (A,), whose swarm starts in ``initial_slots`` (A, N): agent -> slot.

        A ``boot`` above 0 means: restarted in mid-flight, knows nothing but the initial slots.

        Raises:
            agent.policy.PolicyError: the mission's policy cannot be found or made.
        """
        self.mission, self.plan = mission, mission.plan
        self.me = np.asarray(me, np.int64)
        self.policy = policy or find_policy(mission.policy, mission)
        self.parties = Parties(mission, self.me, initial_slots, boot)
        rows = len(self.me)
        self.memory = empty_memory(rows, mission.agents)
        self._constants = _Constants.of(mission)
        self._chain_error = np.zeros((rows, 2))
        self._slot_error = np.zeros((rows, 2))
        self._observation = np.zeros((rows, OBSERVATION_SIZE))
        self._news = np.zeros(rows, np.bool_)
        self._sent = np.zeros(rows, np.bool_)
        self._partner = np.full(rows, trigger.NOBODY, np.int64)
        self._vacated = np.full(rows, trigger.NOBODY, np.int64)

    def restart(self, row: int, tick: int, boot: int) -> None:
        """Row ``row`` lost its memory: what a killed and restarted process comes back as."""
        forget(self.memory, row, tick)
        self.parties.restart(row, boot)

    def step(
        self,
        tick: int,
        awake: NDArray[np.bool_],
        sensed: Sensed,
        frames: Frames,
        notes: list[object],
        inbox_start: NDArray[np.int64],
        inbox: NDArray[np.int64],
        first: int,
    ) -> Step:
        """Decide one tick.

        Args:
            awake: (A,) the rows to act for.
            frames, notes: what was heard, by index: row r hears ``inbox[inbox_start[r]:inbox_start[r + 1]]``. Notes are
                decoded slot notes, read only where ``frames.loud``.
            first: frames and notes rows first + r receive what row r broadcasts.
        """
        mission, plan, memory, parties, known = self.mission, self.plan, self.memory, self.parties, self._constants
        news = cycle.before_policy(
            tick, awake, self.me, inbox_start, inbox, known.by_sensor, mission.sensing.obstacle_memory, known.memory_ticks,
            mission.radio.range_m, mission.sensing.range_m, mission.radio.hops, known.chain, known.rule, mission.swap.margin_m,
            mission.swap.connected, known.silent_ticks, plan.offsets, plan.parent, known.depth, parties.slot_of,
            parties.occupant, parties.digest, parties.busy, self._chain_error, self._slot_error, self._observation,
            self._partner, self._vacated, self._news, *sensed, *frames, *memory,
        )  # fmt: skip
        parties.changed.clear()
        if news and parties.step(tick, self._news, frames, notes, inbox_start, inbox, self._partner, self._vacated):
            cycle.aim_again(
                awake, self.me, known.chain, mission.sensing.range_m, plan.offsets, plan.parent, parties.slot_of,
                parties.occupant, self._chain_error, self._slot_error, self._observation, *sensed, *memory,
            )  # fmt: skip
        command = self.policy.act(
            Seen(tick, self.me, awake, sensed.motion, self._chain_error, self._slot_error, self._observation, memory)
        )
        cycle.after_policy(
            tick, awake, self.me, parties.slot, parties.digest, mission.radio.hops, known.frame_every, first,
            mission.safety_filter, known.limits, self._observation, command, self._sent, *sensed, *frames, *memory,
        )  # fmt: skip
        parties.write_notes(tick, self._sent, frames, notes, first)
        return Step(command, parties.slot, self._sent)

    def status(self, row: int, tick: int, rejected: tuple[int, ...]) -> AgentStatus:
        """Row ``row``'s account of itself; ``rejected`` counts bad frames per protocols.frames.REASONS."""
        party = self.parties.party[row]
        fresh = tick - self.memory.heard_tick[row] <= self._constants.memory_ticks
        counts = tuple(int(getattr(party.counts, name)) for name in SWAP_COUNTS)
        return AgentStatus(int(party.slot), int(fresh.sum()), rejected, counts, int(party.digest), bytes(party.slot_of))
