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

import numpy as np
from numpy.typing import NDArray

from agent import observation, perceive
from agent.control.gains import SafetyLimits
from agent.control.safety import safety_filter
from agent.memory import Memory, empty_memory, forget
from agent.parties import Parties
from agent.policy import Policy, Seen, find_policy
from protocols import trigger
from protocols.formation import NO_PARENT
from protocols.frames import OBSERVATION_SIZE, OBSERVATION_UNIT, Frames
from protocols.kernels import kernel
from protocols.mission import TICK_S, Mission
from protocols.sensed import Sensed
from protocols.status import SWAP_COUNTS, AgentStatus


@kernel
def _choose_swaps(
    tick: int,
    awake: NDArray[np.bool_],
    me: NDArray[np.int64],
    rule: int,
    margin: float,
    connected: bool,
    memory_ticks: int,
    silent: int,
    range_m: float,
    error: NDArray[np.float64],
    offsets: NDArray[np.float64],
    parent: NDArray[np.int16],
    depth: NDArray[np.int64],
    slot_of: NDArray[np.int64],
    occupant: NDArray[np.int64],
    memory: Memory,
    partner: NDArray[np.int64],
    vacated: NDArray[np.int64],
) -> None:
    for row in range(me.shape[0]):
        partner[row], vacated[row] = trigger.NOBODY, trigger.NOBODY
        if not awake[row] or rule == trigger.OFF:
            continue
        ex, ey = error[row, 0], error[row, 1]
        partner[row] = trigger.swap_partner(
            me[row], tick, rule, margin, connected, memory_ticks, range_m, ex, ey, offsets, parent, depth, slot_of[row],
            occupant[row], memory.heard_tick[row], memory.hops[row], memory.rel[row],
        )  # fmt: skip
        vacated[row] = trigger.vacancy_to_fill(
            me[row], tick, silent, ex, ey, offsets, parent, slot_of[row], occupant[row], memory.last_seen[row],
            memory.hops[row], memory.rel[row],
        )  # fmt: skip


@kernel
def _filter(
    awake: NDArray[np.bool_], velocity: NDArray[np.float64], memory: Memory, limits: SafetyLimits, command: NDArray[np.float64]
) -> None:
    for row in range(awake.shape[0]):
        if awake[row]:
            command[row, 0], command[row, 1] = safety_filter(
                command[row, 0], command[row, 1], velocity[row, 0], velocity[row, 1], memory.near_count[row],
                memory.near_rel[row], memory.near_vel[row], memory.disc_count[row], memory.obstacle_rel[row],
                memory.obstacle_radius[row], limits,
            )  # fmt: skip


def tree_depth(parent: NDArray[np.int16]) -> NDArray[np.int64]:
    """(N,) edges from each slot up to the root."""
    depth = np.zeros(len(parent), np.int64)
    for slot in range(len(parent)):
        above = parent[slot]
        while above != NO_PARENT:
            depth[slot] += 1
            above = parent[above]
    return depth


@dataclass(frozen=True)
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
        self._depth = tree_depth(self.plan.parent)
        self._memory_ticks = round(mission.radio.memory_s / TICK_S)
        self._silent = round(mission.swap.silent_s / TICK_S)
        self._limits = SafetyLimits(max_acceleration=mission.limits.acceleration_mps2)
        self._chain_error = np.zeros((rows, 2))
        self._slot_error = np.zeros((rows, 2))
        self._observation = np.zeros((rows, OBSERVATION_SIZE), np.int16)
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
        mission, plan, memory, parties = self.mission, self.plan, self.memory, self.parties
        perceive.perceive(
            tick, awake, self.me, sensed, frames, inbox_start, inbox, mission.sensing.neighbours == "sensed",
            mission.sensing.obstacle_memory, self._memory_ticks, mission.radio.range_m, mission.radio.hops, memory,
        )  # fmt: skip
        chain = mission.aim == "chain"
        self._aim(awake, chain, sensed)
        _choose_swaps(
            tick, awake, self.me, trigger.RULES[mission.swap.rule], mission.swap.margin_m, mission.swap.connected,
            self._memory_ticks, self._silent, mission.radio.range_m, self._chain_error, plan.offsets, plan.parent, self._depth,
            parties.slot_of, parties.occupant, memory, self._partner, self._vacated,
        )  # fmt: skip
        if parties.step(tick, awake, frames, notes, inbox_start, inbox, self._partner, self._vacated):
            self._aim(awake, chain, sensed)
        observation.observe(awake, mission.sensing.range_m, sensed, memory, self._slot_error, self._observation)
        # Copies, not views: a one-row slice would count as contiguous, a longer one not, and kernels compile per layout.
        position, velocity, target_velocity = (sensed.motion[:, at : at + 2].copy() for at in (0, 2, 6))
        command = self.policy.act(
            Seen(
                tick, self.me, awake, position, velocity, target_velocity, self._chain_error, self._slot_error,
                self._observation / OBSERVATION_UNIT, memory,
            )  # fmt: skip
        )
        if mission.safety_filter:
            _filter(awake, velocity, memory, self._limits, command)
        every = mission.frame_every
        # Drones take turns at low frame rates, so that not all speak in the same tick.
        sent = awake & ((tick + self.me) % every == 0)
        perceive.compose_frames(
            tick, sent, self.me, parties.slot, mission.radio.hops, tick // every, sensed, self._observation, memory, frames, first
        )
        parties.write_notes(tick, sent, frames, notes, first)
        return Step(command, parties.slot, sent)

    def status(self, row: int, tick: int, rejected: tuple[int, ...]) -> AgentStatus:
        """Row ``row``'s account of itself; ``rejected`` counts bad frames per protocols.frames.REASONS."""
        party = self.parties.party[row]
        fresh = tick - self.memory.heard_tick[row] <= self._memory_ticks
        counts = tuple(int(getattr(party.counts, name)) for name in SWAP_COUNTS)
        return AgentStatus(int(party.slot), int(fresh.sum()), rejected, counts, int(party.digest), bytes(party.slot_of))

    def _aim(self, awake: NDArray[np.bool_], chain: bool, sensed: Sensed) -> None:
        observation.aim(
            awake, self.me, chain, sensed, self.memory, self.plan.offsets, self.plan.parent, self.parties.slot_of,
            self.parties.occupant, self._chain_error, self._slot_error,
        )  # fmt: skip
