"""A bad network without sockets and in no time: what goes between the world and its drones is late, lost and out of order.

The clock is part of it: while the world waits, it leaps to what comes next. So a flight in real time takes as long as its rules.
"""

import heapq
import random
from dataclasses import dataclass

from protocols.mission.document import Mission
from protocols.wire import messages
from protocols.wire.messages import Tick
from tests.loopback import Loopback
from world.outcome import Flown
from world.server.running_time import RunningTime
from world.server.session import WorldServer


@dataclass(frozen=True)
class Network:
    """How every link is, each way. A cut is (from, to, drones that nothing reaches and that reach nobody)."""

    delay_s: float = 0.0
    jitter_s: float = 0.0
    loss: float = 0.0
    cuts: tuple[tuple[float, float, tuple[int, ...]], ...] = ()


class VirtualNet(Loopback):
    """Ticks and answers suffer from the network; everything else arrives, as what is said again until it does."""

    def __init__(self, mission: Mission, network: Network, seed: int = 0) -> None:
        self.now = 0.0
        self._network, self._chance = network, random.Random(seed)
        self._under_way: list[tuple[float, int, int, bytes | Tick]] = []
        self._sent = 0
        super().__init__(mission)

    def _carry(self, agent: int, what: bytes | Tick) -> None:
        net = self._network
        cut = any(since <= self.now < until and agent in drones for since, until, drones in net.cuts)
        if cut or self._chance.random() < net.loss:
            return
        self._sent += 1
        at = self.now + net.delay_s + self._chance.uniform(-1, 1) * net.jitter_s
        heapq.heappush(self._under_way, (at, self._sent, agent, what))

    def cast(self, agent: int, payload: bytes) -> bool:
        message = messages.unpack_from_world(payload)
        if isinstance(message, Tick):
            self._carry(agent, message)
        return True

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        if self._said:
            return self._said.popleft()
        until = self.now + timeout_s
        while self._under_way and self._under_way[0][0] <= until:
            at, _, agent, what = heapq.heappop(self._under_way)
            self.now = max(self.now, at)
            if isinstance(what, bytes):
                return agent, what
            if what.tick > self.drones[agent].world.tick:
                self._carry(agent, self.drones[agent].answer(what))
        self.now = until
        return None


def fly(mission: Mission, network: Network, seed: int = 0) -> Flown:
    """Fly ``mission`` in real time over such a network."""
    net = VirtualNet(mission, network, seed)
    world = WorldServer(mission, net, "realtime", net)
    world._time = RunningTime(lambda: net.now)
    return world.run()
