"""AgentCore: one tick of one or more drones, without IO.

A drone's process hosts one row, the in-process simulation all N drones, a batch all drones of all its worlds; the code is
the same. Each tick, for every awake row:

    perceive   sensors and heard frames -> neighbours, relative positions, obstacles, who is silent
    slots      hear the neighbours' slot notes; propose a swap or take a dead leader's slot where the trigger asks for it
    aim        slot -> targets; the observation X_i
    policy     -> wanted acceleration
    detour     -> where obstacles have stopped it, the way around them instead
    filter     -> safe acceleration: the command
    compose    the broadcast frame, when one is due
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from agent import tick as cycle
from agent.memory import empty_memory, forget
from agent.policy import Policy, Seen, find_policy
from agent.policy.asking import ask, call
from agent.rules import rules_of, shape_of
from agent.slot_endpoints import SlotEndpoints
from agent.tick_arrays import empty_views, empty_work, make_tick_arrays
from protocols.mission.document import Mission
from protocols.wire.frames import Frames
from protocols.wire.sensed import Sensed
from protocols.wire.status import SWAP_COUNTS, AgentStatus


class AgentCore:
    """A drones of swarms that fly the same mission (up to seeds).

    Before `step`, its shell fills ``sensed``, ``frames`` and ``notes`` with what is sensed and heard, and in ``work`` who is
    awake and which frames each row hears. Afterwards ``work.sent`` says who broadcast.
    """

    def __init__(
        self,
        mission: Mission,
        me: Sequence[int],
        initial_slots: NDArray[np.int16],
        sensed: Sensed,
        frames: Frames,
        inbox_size: int,
        boot: int = 0,
        policy: Policy | None = None,
        rehearsal: bool = False,
    ) -> None:
        """Make the drones numbered ``me`` (A,), whose swarm starts in ``initial_slots`` (A, N): agent -> slot.

        Args:
            sensed, frames: the arrays in which sensors and frames arrive, and into which frames are composed.
            inbox_size: frames that all rows together can hear in one tick.
            boot: above 0 means restarted in mid-flight, knowing nothing but the initial slots.
            rehearsal: this process will fork: load all code, but open nothing.

        Raises:
            agent.policy.PolicyError: the mission's policy cannot be found or made.
        """
        agents = np.asarray(me, np.int64)
        self.mission, self.sensed, self.frames = mission, sensed, frames
        self.notes: list[object] = [None] * len(frames.tick)
        self.policy = policy or find_policy(mission.policy, mission)
        self._opened = rehearsal
        self.work = empty_work(agents, inbox_size)
        self.memory = empty_memory(len(agents), mission.agents)
        self.views = empty_views(len(agents), mission.agents)
        self.endpoints = SlotEndpoints(mission, agents, initial_slots, self.views, boot)
        self._rules, self._shape = rules_of(mission), shape_of(mission)
        self.arrays = make_tick_arrays(
            self._rules, self._shape, self.views, self.work, sensed, frames, self.memory
        )

    def restart(self, row: int, tick: int, boot: int) -> None:
        """Row ``row`` lost its memory: what a killed and restarted process comes back as."""
        forget(self.memory, row, tick)
        self.endpoints.restart(row, boot)
        if hasattr(self.policy, "forget"):
            call(self.policy.forget, self.mission.policy, row)

    def open(self) -> None:
        """Open what the policy needs, if it has not been done; else the first `step` does it.

        Raises:
            agent.policy.PolicyError: it cannot be opened.
        """
        if not self._opened and hasattr(self.policy, "open"):
            call(self.policy.open, self.mission.policy)
        self._opened = True

    def load_rare_kernels(self) -> None:
        """Load (or compile) what only some ticks need: at the first swap there is no time for it."""
        cycle.aim_again(self.arrays)

    def step(self, tick: int, first: int) -> NDArray[np.float64]:
        """Decide one tick for the awake rows; return the commands (A, 2), accelerations in m/s^2.

        What row r broadcasts goes into row first + r of ``frames`` and ``notes``. A note is read only where ``frames.loud``.

        Raises:
            agent.policy.PolicyError: the policy raised or wants no accelerations; one line says where.
        """
        work, arrays = self.work, self.arrays
        self.open()
        self.endpoints.changed.clear()
        if cycle.before_policy(tick, arrays) and self.endpoints.step(tick, work, self.frames, self.notes):
            cycle.aim_again(arrays)
        seen = Seen(
            tick,
            work.me,
            work.awake,
            self.sensed.motion[:, :2],
            self.sensed.motion[:, 2:],
            work.target_position,
            work.target_velocity,
            work.chain_error,
            work.slot_error,
            work.observation,
            self.memory,
            arrays,
        )
        command = ask(self.policy, self.mission.policy, seen)
        cycle.after_policy(tick, first, arrays, command)
        self.endpoints.write_notes(tick, work.sent, self.frames, self.notes, first)
        return command

    def status(self, row: int, tick: int, rejected: tuple[int, ...]) -> AgentStatus:
        """Row ``row``'s account of itself; ``rejected`` counts bad frames per protocols.wire.frames.REASONS."""
        party = self.endpoints.endpoint[row]
        fresh = tick - self.memory.heard_tick[row] <= self._rules.memory_ticks
        counts = tuple(int(getattr(party.counts, name)) for name in SWAP_COUNTS)
        return AgentStatus(
            int(party.slot), int(fresh.sum()), rejected, counts, int(party.digest), bytes(party.slot_of)
        )
