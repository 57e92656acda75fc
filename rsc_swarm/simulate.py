"""Flights in one process: WorldCore and AgentCore face to face, no Zenoh, no processes.

One mission is a batch of one. Drones share the rows of `Frames` instead of packing and unpacking them; the rows hold
exactly what the wire would carry, so a flight here has the digest of its twin in real processes.
"""

from collections.abc import Callable, Sequence

import numpy as np

from agent.core import AgentCore
from protocols.frames import Frames, empty_frames, encode_frame, swarm_tag
from protocols.mission import Mission
from protocols.swap import encode
from world.core import Outcome, WorldCore

Watch = Callable[["Simulation"], None]


class Simulation:
    """E worlds of N drones, all in step."""

    def __init__(self, missions: Sequence[Mission]) -> None:
        """Make the worlds and the drones.

        Raises:
            world.field.FieldError, agent.policy.PolicyError: as WorldCore and AgentCore.
        """
        self.mission = missions[0]
        self.world = WorldCore(missions)
        worlds, agents = self.world.shape
        self._rows = worlds * agents
        me = np.tile(np.arange(agents), worlds)
        initial = np.repeat(self.world.initial_slots, agents, axis=0)
        self.agents = AgentCore(self.mission, [int(agent) for agent in me], initial)
        self._frames: Frames = empty_frames(self.world.ring * self._rows)
        self._notes: list[object] = [None] * (self.world.ring * self._rows)
        self._tag = swarm_tag(self.mission.swarm)
        self._quiet_bytes = len(encode_frame(self._tag, empty_frames(1), 0, encode(self.agents.parties.party[0].note(0))))
        self._boots = np.zeros(self._rows, np.int64)
        self.clock = 0

    def tick(self) -> list[int]:
        """Fly one tick in every world; return the worlds whose flight has just ended."""
        world, agents = self.world, self.agents
        for event in world.begin_tick():
            if event.fault.kind == "restart":
                for agent in event.agents:
                    row = event.world * world.shape[1] + agent
                    self._boots[row] += 1
                    agents.restart(row, self.clock, int(self._boots[row]))
        sensed = world.sense()
        start, arrived = world.deliver()
        inbox = (arrived[:, 1].astype(np.int64) % world.ring) * self._rows + arrived[:, 0]
        first = (self.clock % world.ring) * self._rows
        awake = world.rows_awake
        step = agents.step(self.clock, awake, sensed, self._frames, self._notes, start, inbox, first)
        self.clock += 1
        return world.advance(step.command, self._sizes(step.sent, first), step.slot)

    def _sizes(self, sent: np.ndarray, first: int) -> np.ndarray:
        """(A,) bytes each drone's frame would have on the wire."""
        rows = slice(first, first + self._rows)
        sizes = np.where(sent, self._quiet_bytes + 9 * self._frames.known_count[rows].astype(np.int64), 0)
        for row in np.flatnonzero(sent & (self._frames.loud[rows] > 0)):
            sizes[row] = len(
                encode_frame(self._tag, self._frames, first + row, encode(self._notes[first + row]))  # type: ignore[arg-type]
            )
        return sizes


def simulate(missions: Sequence[Mission], watch: Watch | None = None) -> list[Outcome]:
    """Fly all missions to their ends; ``watch`` is called after every tick.

    The missions must agree in all but seeds and faults.
    """
    simulation = Simulation(missions)
    while simulation.world.active.any():
        simulation.tick()
        if watch:
            watch(simulation)
    return [outcome for outcome in simulation.world.outcomes if outcome is not None]
