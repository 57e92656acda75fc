"""Flights in one process: WorldCore and AgentCore face to face, no Zenoh, no processes.

One mission is a batch of one. Drones share the rows of `Frames` instead of packing and unpacking them; the rows hold
exactly what the wire would carry, so a flight here has the digest of its twin in real processes.
"""

from collections.abc import Sequence

import numpy as np

from agent.core import AgentCore, Inputs
from agent.radio.air import Air
from protocols.mission.document import Mission
from protocols.wire.frames import REASONS
from protocols.wire.status import AgentStatus
from world.core import Outcome, WorldCore
from world.invariants import Watch


class Simulation:
    """E worlds of N drones, all in step."""

    def __init__(self, missions: Sequence[Mission], rehearsal: bool = False) -> None:
        """Make the worlds and the drones; for a ``rehearsal``, in a process that will fork, they open nothing.

        Raises:
            world.field.FieldError, agent.policy.PolicyError: as WorldCore and AgentCore.
        """
        self.mission = missions[0]
        self.world = WorldCore(missions)
        worlds, agents = self.world.shape
        self._rows = worlds * agents
        self._air = Air(self.mission.swarm, agents, self.world.ring * self._rows)
        me = [agent for _ in missions for agent in range(agents)]
        initial = np.repeat(self.world.initial_slots, agents, axis=0)
        self.agents = AgentCore(self.mission, me, initial, self.world.inbox_size, rehearsal=rehearsal)
        self.watches = [Watch(agents, self.mission.swap.cooldown_s) for _ in missions]
        self._boots = np.zeros(self._rows, np.int64)
        self.frame_bytes = np.zeros(self._rows, np.int64)  # of the last tick, 0 for a drone that sent nothing
        self.clock = 0

    def tick(self) -> list[int]:
        """Fly one tick in every world; return the worlds whose flight has just ended."""
        world, agents = self.world, self.agents
        for event in world.begin_tick():
            self.watches[event.world].fault(self.clock)
            if event.fault.kind == "restart":
                for agent in event.agents:
                    row = event.world * world.shape[1] + agent
                    self._boots[row] += 1
                    agents.restart(row, self.clock, int(self._boots[row]))
        sensed, (start, arrived) = world.sense(), world.deliver()
        heard = (arrived[:, 1].astype(np.int64) % world.ring) * self._rows + arrived[:, 0]
        first = (self.clock % world.ring) * self._rows
        said = agents.tick(Inputs(self.clock, world.rows_awake, sensed, self._air, start, heard, first))
        self.frame_bytes = self._air.sizes(first, said.sent)
        ended = world.advance(said.command, self.frame_bytes, said.slot)
        ended += self._watch(said.changed)
        self.clock += 1
        return ended

    def _watch(self, changed: tuple[int, ...]) -> list[int]:
        """Show the watches the views that changed; end flights whose invariants broke or whose drones are all gone."""
        world, agents = self.world, self.world.shape[1]
        for row in changed:
            self.watches[row // agents].see(self.clock, row % agents, self.status(row))
        ended = []
        for index in np.flatnonzero(world.active):
            awake = np.flatnonzero(world.flying[index] & world.responsive[index])
            self.watches[index].tick(self.clock, awake.tolist(), world.could_know(int(index)))
            if self.watches[index].breach:
                world.end(int(index), "broken-invariant")
            elif not world.flying[index].any():
                world.end(int(index), "all-lost")
            else:
                continue
            ended.append(int(index))
        return ended

    def status(self, row: int) -> AgentStatus:
        """The account of the drone in row world * N + agent; nothing is rejected where nothing is unpacked."""
        return self.agents.status(row, self.clock, (0,) * len(REASONS))


def simulate(missions: Sequence[Mission]) -> list[Outcome]:
    """Fly all missions to their ends. They must agree in all but seeds and faults."""
    simulation = Simulation(missions)
    while simulation.world.active.any():
        simulation.tick()
    return [outcome for outcome in simulation.world.outcomes if outcome is not None]
