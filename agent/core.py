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
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent import tick as cycle
from agent.memory import Memory, empty_memory, forget
from agent.policy import Seen, find_policy
from agent.policy.asking import absurd, ask, call
from agent.policy.base import Compiled
from agent.radio.air import Air
from agent.rules import rules_of, shape_of
from agent.slot_endpoints import SealsOf, SlotEndpoints
from agent.tick_arrays import TickArrays, empty_views, empty_work
from protocols.kernels import by_reference
from protocols.mission.document import Mission
from protocols.slots.seals import Stamps
from protocols.slots.written import pack_slots
from protocols.wire.planned import Planned, pack_plan
from protocols.wire.sensed import Sensed
from protocols.wire.status import SWAP_COUNTS, AgentStatus

_counts_of = attrgetter(*SWAP_COUNTS)


class Inputs(NamedTuple):
    """Where what reaches A drones lies; the same arrays every tick, filled anew.

    awake: (A,) who acts; the others sense, hear and say nothing. sensed: A rows. air: where frames are heard and said.
    heard: rows of ``air`` that have been heard, ``heard[start[r]:start[r + 1]]`` by drone r; start: (A + 1,).
    """

    awake: NDArray[np.bool_]
    sensed: Sensed
    air: Air
    start: NDArray[np.int64]
    heard: NDArray[np.int64]


class Outputs(NamedTuple):
    """What A drones do about it. The arrays are theirs and change with the next tick; of those not awake they say nothing.

    command: (A, 2) accelerations [m/s^2]. sent: (A,) who has put a frame on the air. slot: (A,) the slot each believes to hold.
    changed: the drones whose view of the slots changed.
    """

    command: NDArray[np.float64]
    sent: NDArray[np.bool_]
    slot: NDArray[np.int64]
    changed: tuple[int, ...]


class AgentCore:
    """A drones of swarms that fly the same mission (up to seeds): what they know, and `tick`.

    Attributes:
        policy: what they fly. arrays: all that they know and do, from the first tick on.
        command: (A, 2) m/s^2, what a compiled policy wants and the filter makes of it.
    """

    def __init__(
        self,
        mission: Mission,
        me: Sequence[int],
        initial_slots: NDArray[np.int16],
        boot: int = 0,
        rehearsal: bool = False,
        seals_of: SealsOf = Stamps,
    ) -> None:
        """Make the drones numbered ``me`` (A,), whose swarm starts in ``initial_slots`` (A, N): agent -> slot.

        Args:
            boot: above 0 means restarted in mid-flight, knowing nothing but the initial slots.
            rehearsal: this process will fork: load all code, and open only what can be shared.
            seals_of: what each drone seals its swaps with; without, what is good enough for drones of one process.

        Raises:
            agent.policy.PolicyError: the mission's policy cannot be found or made.
        """
        agents = np.asarray(me, np.int64)
        self.mission = mission.told
        self.policy = find_policy(mission.policy, self.mission)
        if rehearsal and hasattr(self.policy, "share"):
            call(self.policy.share, mission.policy)
        self._opened = rehearsal
        self._rules, self._shape = rules_of(mission), shape_of(mission)
        rounds = self.policy.rounds if isinstance(self.policy, Compiled) else 0
        self._work = empty_work(agents, rounds)
        self.command = np.zeros((len(agents), 2))
        self._memory = empty_memory(len(agents), mission.agents, rounds > 0)
        self._views = empty_views(len(agents), mission.agents)
        self._endpoints = SlotEndpoints(
            mission, agents, initial_slots, self._views, boot, seals_of, rounds > 0
        )
        self._inputs: Inputs | None = None

    def restart(self, row: int, tick: int, boot: int) -> None:
        """Row ``row`` lost its memory: what a killed and restarted process comes back as."""
        forget(self._memory, row, tick)
        self._endpoints.restart(row, boot)
        if hasattr(self.policy, "forget"):
            call(self.policy.forget, self.mission.policy, row)

    def open(self) -> None:
        """Open what the policy needs, if it has not been done; else the first `tick` does it.

        Raises:
            agent.policy.PolicyError: it cannot be opened.
        """
        if not self._opened and hasattr(self.policy, "open"):
            call(self.policy.open, self.mission.policy)
        self._opened = True

    def _begin(self, tick: int, inputs: Inputs) -> None:
        """Before the first tick, and where other arrays come than before."""
        memory, sensed = self._memory, inputs.sensed
        if self._inputs is None:
            for row in range(len(self._work.me)):
                forget(memory, row, tick)  # whoever begins in mid-flight takes nobody for dead
        self._inputs = inputs
        work = self._work._replace(awake=inputs.awake, inbox_start=inputs.start, inbox=inputs.heard)
        self._work = work
        self.arrays = TickArrays(
            self._rules, self._shape, self._views, work, sensed, inputs.air.frames, memory
        )
        self._page = by_reference(self.arrays)
        self._shown: dict[str, NDArray[Any] | Memory] = {
            "me": work.me, "awake": work.awake, "position": sensed.position, "velocity": sensed.velocity,
            "target_position": work.target_position, "target_velocity": work.target_velocity,
            "chain_error": work.chain_error, "slot_error": work.slot_error, "observation": work.observation, "memory": memory,
        }  # fmt: skip

    def tick(self, tick: int, inputs: Inputs, first: int) -> Outputs:
        """Decide one tick for the awake rows. What drone r says goes into row first + r of ``inputs.air``.

        Raises:
            agent.policy.PolicyError: the policy raised or wants no accelerations; one line says where.
        """
        begins = inputs is not self._inputs
        if begins:
            self.open()
            self._begin(tick, inputs)
        arrays, work, air, endpoints = self._page, self._work, inputs.air, self._endpoints
        changed = endpoints.step(tick, work, air) if cycle.before_policy(tick, False, arrays) else ()
        if changed:
            cycle.before_policy(tick, True, arrays)
        policy, name = self.policy, self.mission.policy
        if isinstance(policy, Compiled):
            command = self.command
            call(policy.act_on_arrays, name, tick, arrays, command)
        else:
            command = ask(policy, name, Seen(tick, self._shown, arrays), len(work.me))
        wrong = cycle.after_policy(tick, first, arrays, command)
        if wrong >= 0:
            raise absurd(policy, name, int(work.me[wrong]), command[wrong])
        endpoints.write_notes(tick, work.sent, air, first)
        return Outputs(command, work.sent, self._views.slot, changed)

    def plans(self, tick: int) -> NDArray[np.float32] | None:
        """Where the rows plan to be, (A, P, 2) m, NaN where a row plans nothing; None with a policy that does not say."""
        return self.policy.plans(tick) if isinstance(self.policy, Compiled) else None

    def plan_of(self, tick: int) -> bytes:
        """What the one row there is planned at this tick, as it travels (protocols.wire.planned); empty if it planned nothing."""
        policy = self.policy
        if not isinstance(policy, Compiled) or policy.made_at is None or policy.made_at[0] != tick:
            return b""
        plans = policy.plans(tick)
        return b"" if plans is None else pack_plan(Planned(policy.shown_after, plans[0]))

    def status(self, row: int, tick: int, rejected: tuple[int, ...]) -> AgentStatus:
        """Row ``row``'s account of itself; ``rejected`` counts bad frames per protocols.wire.frames.REASONS."""
        party = self._endpoints.endpoint[row]
        fresh = self._memory.heard_tick[row] >= tick - self._rules.radio.memory_ticks
        heard, view = int(np.count_nonzero(fresh)), pack_slots(party.view)
        return AgentStatus(party.slot, heard, rejected, _counts_of(party.counts), party.digest, view)
