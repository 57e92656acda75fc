"""A whole swarm without processes and without Zenoh: the world's link ends in drones of this process.

Every byte that would travel does travel; what a drone says can be tampered with on the way.
"""

import time
from collections import deque
from collections.abc import Callable

from agent.process import Drone
from protocols.mission.document import Mission, parse_mission
from protocols.wire import messages
from world.outlets.snapshot import Snapshot
from world.server.session import Clock, Flown, WorldServer

Meddle = Callable[[int, int, bytes], list[bytes]]  # agent, tick, its reply -> what reaches the world instead
_NAP_S = 0.002


class Loopback:
    """Link and control of a `WorldServer` in one: drones answer at once, and do what is done to processes."""

    def __init__(self, mission: Mission, meddle: Meddle | None = None) -> None:
        self.mission = mission
        self.drones: dict[int, Drone] = {}
        self.gone: list[int] = []  # processes to be reported as ended
        self.pictures: list[Snapshot] = []
        self.waits = 0
        self.applied: list[tuple[str, tuple[int, ...]]] = []
        self.leave_at: int | None = None  # tick
        self._meddle = meddle or (lambda agent, tick, reply: [reply])
        self._alive = set(range(mission.agents))
        self._said: deque[tuple[int, bytes]] = deque()
        self._tick = -1
        for agent in range(mission.agents):
            self.say(agent, messages.pack(messages.HELLO, messages.VERSION))

    def say(self, agent: int, data: bytes) -> None:
        """This reaches the world as from ``agent``."""
        self._said.append((agent, data))

    def send(self, agent: int, payload: bytes) -> None:
        kind, fields = messages.unpack(payload)
        self.waits += kind == messages.WAIT
        if agent not in self._alive:
            return
        if kind == messages.WELCOME:
            mission, slots, boot = fields
            self.drones[agent] = Drone(parse_mission(mission), agent, slots, boot)
            self.say(agent, messages.pack(messages.READY))
        elif kind == messages.TICK:
            self._tick = fields[0]
            for data in self._meddle(agent, fields[0], self.drones[agent].answer(*fields)):
                self.say(agent, data)
        elif kind == messages.BYE and agent in self.drones:
            self.say(agent, self.drones[agent].farewell())

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        if self._said:
            return self._said.popleft()
        if timeout_s > 0:
            time.sleep(min(timeout_s, _NAP_S))
        return None

    def apply(self, kind: str, agents: tuple[int, ...]) -> None:
        self.applied.append((kind, agents))
        for agent in agents:
            if kind in ("kill", "restart"):
                self._alive.discard(agent)
            if kind == "restart":
                self._alive.add(agent)
                self.say(agent, messages.pack(messages.HELLO, messages.VERSION))

    def lost(self) -> list[int]:
        gone, self.gone = self.gone, []
        return gone

    def show(self, picture: Snapshot) -> None:
        self.pictures.append(picture)

    def leaving(self) -> bool:
        return self.leave_at is not None and self._tick >= self.leave_at


def fly(mission: Mission, meddle: Meddle | None = None, clock: Clock = "lockstep") -> Flown:
    """Fly ``mission`` over bytes, in this process."""
    swarm = Loopback(mission, meddle)
    return WorldServer(mission, swarm, clock, swarm).run()
