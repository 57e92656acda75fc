"""Flights in one process: WorldCore and AgentCore face to face, no Zenoh, no processes.

One mission is a batch of one. Drones share the rows of `Frames` instead of packing and unpacking them; the rows hold
exactly what the wire would carry, so a flight here has the digest of its twin in real processes.
"""

from collections.abc import Sequence
from weakref import proxy

import numpy as np
from numpy.typing import NDArray

from agent.core import Inputs
from agent.radio.air import Air
from protocols.mission.document import Mission
from protocols.wire.frames import REASONS
from protocols.wire.status import AgentStatus, is_due
from rsc_swarm.flight.policy_facts import policy_facts
from rsc_swarm.flight.side_by_side import drones_of
from world.core import Answers, Inbox, WorldCore
from world.director import Director
from world.faults import Event
from world.invariants import Invariants
from world.liars import Liars
from world.outcome import Outcome

ROWS = 600  # drones in step: more would hardly be faster, and flights would end in larger bunches


class Simulation:
    """E worlds of N drones, all in step: the swarm of `world.director.Director` whose drones share a process."""

    def __init__(
        self,
        missions: Sequence[Mission],
        rehearsal: bool = False,
        telling: bool = False,
        watched: bool = False,
        both: bool = True,
        threads: int = 1,
    ) -> None:
        """Make the worlds and the drones; for a ``rehearsal``, in a process that will fork, they open nothing.

        Args:
            watched, both: as WorldCore.
            telling: every drone gives an account of itself now and then, for a whole report of each flight. In several worlds
                they else tell only what the invariants must know.
            threads: that fly the drones.

        Raises:
            world.field.FieldError, agent.policy.PolicyError: as WorldCore and AgentCore.
        """
        self.mission = missions[0]
        self.world = WorldCore(missions, watched, both)
        worlds, agents = self.world.shape
        self._rows, self._telling = worlds * agents, telling or worlds == 1
        self._air = Air(self.mission.swarm, agents, self.world.ring * self._rows)
        me = [agent for _ in missions for agent in range(agents)]
        initial = np.repeat(self.world.initial_slots, agents, axis=0)
        self.agents = drones_of(self.mission, me, initial, rehearsal, threads)
        self._heard = np.zeros(self.world.inbox_size, np.int64)
        self._inputs = Inputs(
            np.ones(self._rows, np.bool_), self.world.sensed, self._air, self.world.inbox_start, self._heard
        )
        self._boots = np.zeros(self._rows, np.int64)
        self._liars = Liars(self.world)
        # Weakly: two that hold each other stay until the collector comes, and these have much to hold.
        self.director = Director(self.world, proxy(self))

    @property
    def clock(self) -> int:
        """Ticks flown."""
        return self.director.clock

    @property
    def invariants(self) -> list[Invariants]:
        """What was watched, per world."""
        return self.director.invariants

    def tick(self) -> list[int]:
        """Fly one tick in every world; return the worlds whose flight has just ended."""
        return self.director.tick()

    def strike(self, event: Event) -> None:
        """A restarted drone has lost its memory; all else happens in the world."""
        if event.fault.kind == "restart":
            for agent in event.agents:
                row = event.world * self.world.shape[1] + agent
                self._boots[row] += 1
                self.agents.restart(row, self.clock, int(self._boots[row]))

    def struck_off(self, row: int) -> None:
        """It is asked no more, and that is all."""

    def ask(self, tick: int, inbox: Inbox) -> Answers:
        """Let every drone that is awake decide."""
        world, arrived = self.world, inbox.arrived
        self._heard[: len(arrived)] = (arrived[:, 1].astype(np.int64) % world.ring) * self._rows + arrived[
            :, 0
        ]
        first = (tick % world.ring) * self._rows
        self._inputs.awake[:] = awake = world.rows_awake
        said = self.agents.tick(tick, self._inputs, first)
        if world.condition.lies:
            self._lie(tick, first, said.sent)
        telling = said.changed
        if self._telling and is_due(tick, changed=False):
            telling = tuple(np.flatnonzero(awake).tolist())
        accounts = [(row, self.status(row, tick)) for row in telling]
        return Answers(said.command, self._air.sizes(first, said.sent), said.slot, accounts)

    def _lie(self, tick: int, first: int, sent: NDArray[np.bool_]) -> None:
        """What liars have said becomes what they are to say."""
        for row in self._liars.rows:
            if sent[row]:
                self._air.unpack(first + row, self._liars.tell(row, tick, self._air.pack(first + row)))

    def farewell(self) -> list[tuple[int, AgentStatus]]:
        """The last accounts of all drones that fly and answer."""
        world = self.world
        rows = np.flatnonzero(world.flying & world.responsive).tolist()
        return [(row, self.status(row, self.clock - 1)) for row in rows]

    def plans(self, world: int) -> NDArray[np.float32] | None:
        """Where the drones of this world plan to be, (N, P, 2) m."""
        plans, agents = self.agents.plans(self.clock), self.world.shape[1]
        return None if plans is None else plans[world * agents : (world + 1) * agents]

    def status(self, row: int, tick: int) -> AgentStatus:
        """The account of the drone in row world * N + agent; nothing is rejected where nothing is unpacked."""
        return self.agents.status(row, tick, (0,) * len(REASONS))


def flights_at_once(mission: Mission) -> int:
    """How many flights of a mission, which differ in seeds and obstacles, one `Simulation` flies best.

    One alone if the policy does not say that it takes the rows of several (agent.policy.Policy): it may remember by drone, or
    look at the seed of its mission.

    Raises:
        agent.policy.PolicyError: the mission's policy cannot be found or made.
    """
    return max(1, ROWS // mission.agents) if policy_facts(mission).many_flights else 1


def simulate(missions: Sequence[Mission]) -> list[Outcome]:
    """Fly all missions to their ends. They must agree in all but seeds and faults."""
    simulation = Simulation(missions)
    while simulation.world.active.any():
        simulation.tick()
    return [outcome for outcome in simulation.world.outcomes if outcome is not None]
