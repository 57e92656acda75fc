"""A whole swarm without processes and without Zenoh: the world's link ends in drones of this process.

Every byte that would travel does travel; what a drone says can be tampered with on the way.
"""

import time
from collections import deque
from collections.abc import Callable

from agent.body.relayed import RelayedWorld
from agent.process import Drone
from protocols.mission.document import Mission, parse_briefing
from protocols.wire import messages
from protocols.wire.messages import Bye, Farewell, Hello, Ready, Tick, Wait, Welcome
from world.outcome import Flown
from world.outlets.snapshot import Snapshot
from world.server.ports import STRUCK_OFF, Lost
from world.server.session import Clock, WorldServer

Meddle = Callable[[int, int, bytes], list[bytes]]  # agent, tick, its reply -> what reaches the world instead
_NAP_S = 0.002


class Hosted:
    """A drone whose process is this one: a Tick in, a Reply out, packed."""

    def __init__(self, mission: Mission, agent: int, welcome: Welcome) -> None:
        self.mission, self.world = mission, RelayedWorld(welcome.process)
        self.drone = Drone(mission, agent, welcome.initial_slots, welcome.boot, self.world, self.world)
        self.quick = self.drone.answer_quickly(self.world)
        if welcome.watched:
            self.drone.tell_plans(self.world)

    def answer(self, asked: Tick) -> bytes:
        """One tick; where it is asked again, the same answer."""
        if asked.tick > self.world.tick and self.quick(asked.data) is None:
            self.world.take(asked)
            self.drone.act(asked.tick)
        return self.world.reply()

    def farewell(self) -> Farewell:
        """Its last word."""
        return self.world.farewell(self.drone.status())


class Loopback:
    """Link and control of a `WorldServer` in one: drones answer at once, and do what is done to processes."""

    watches = False

    def __init__(self, mission: Mission, meddle: Meddle | None = None) -> None:
        self.mission = mission
        self.drones: dict[int, Hosted] = {}
        self.gone: list[Lost] = []  # processes to be reported as ended
        self.stopped: set[int] = set()  # processes that are known to be stopped
        self.told: dict[int, int] = {}  # messages that each was sent
        self.process = {agent: 100 + agent for agent in range(mission.agents)}
        self.pictures: list[Snapshot] = []
        self.ready: list[int] = []  # drones, while they gather
        self.waits = 0
        self.refused: dict[int, int] = {}  # messages of each that a link would have turned away
        self.applied: list[tuple[str, tuple[int, ...]]] = []
        self.leave_at: int | None = None  # tick
        self._meddle = meddle or (lambda agent, tick, reply: [reply])
        self._alive = set(range(mission.agents))
        self._said: deque[tuple[int, bytes]] = deque()
        self._tick = -1
        for agent in range(mission.agents):
            self.knock(agent)

    def knock(self, agent: int) -> None:
        """Its process asks to take part."""
        self.say(agent, messages.pack(Hello(messages.VERSION, self.process[agent])))

    def say(self, agent: int, data: bytes) -> None:
        """This reaches the world as from ``agent``."""
        self._said.append((agent, data))

    def send(self, agent: int, payload: bytes) -> None:
        message = messages.unpack_from_world(payload)
        self.waits += isinstance(message, Wait)
        self.told[agent] = self.told.get(agent, 0) + 1
        if agent not in self._alive:
            return
        if isinstance(message, Welcome) and message.process == self.process[agent]:
            self.drones[agent] = Hosted(parse_briefing(message.briefing, self.mission.policy), agent, message)
            self.say(agent, messages.pack(Ready(message.process)))
        elif isinstance(message, Tick):
            self._tick = message.tick
            reply = self.drones[agent].answer(message)
            for data in self._meddle(agent, message.tick, reply):
                self.say(agent, data)
        elif isinstance(message, Bye) and agent in self.drones:
            self.say(agent, messages.pack(self.drones[agent].farewell()))

    def offer(self, agent: int, process: int) -> bytes | None:
        return None

    def cast(self, agent: int, payload: bytes) -> bool:
        return False

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        if self._said:
            return self._said.popleft()
        if timeout_s > 0:
            time.sleep(min(timeout_s, _NAP_S))
        return None

    def turned_away(self, agent: int) -> int:
        return self.refused.get(agent, 0)

    def bar(self, agent: int) -> None:
        self._alive.discard(agent)

    def apply(self, kind: str, agents: tuple[int, ...]) -> None:
        self.applied.append((kind, agents))
        for agent in agents:
            if kind in ("kill", "restart", STRUCK_OFF):
                self._alive.discard(agent)
            if kind == "restart":
                self._alive.add(agent)
                self.process[agent] += 100
                self.knock(agent)

    def paused(self, agent: int) -> bool:
        return agent in self.stopped

    def lost(self) -> list[Lost]:
        gone, self.gone = self.gone, []
        return gone

    def gathered(self, ready: int) -> None:
        self.ready.append(ready)

    def show(self, picture: Snapshot) -> None:
        self.pictures.append(picture)

    def leaving(self) -> bool:
        return self.leave_at is not None and self._tick >= self.leave_at


def fly(mission: Mission, meddle: Meddle | None = None, clock: Clock = "lockstep") -> Flown:
    """Fly ``mission`` over bytes, in this process."""
    swarm = Loopback(mission, meddle)
    return WorldServer(mission, swarm, clock, swarm).run()
