"""Mixed reality: drones whose bodies are outside of the world. They say where they are, and what they say reaches whom it may.

The swarm of `world.director.Director` for such drones, of one world, without input or output. Between two poses a body goes on by
its velocity, which is all that the world moves of it.

What goes beyond the reach of the mission's radio is no frame of the mission; but in a room all hear all, and whoever guards a
drone counts on that. So a part of what is said goes there, too, unless the swarm is parted or independent loss takes it.
"""

from collections import deque

import numpy as np

from protocols.wire.status import AgentStatus
from world.core import Answers, Inbox, WorldCore
from world.director import Swarm
from world.medium.medium import dropped_by

_MOST_WAITING = 8  # of what one drone said and has not been put on the air

Carried = tuple[int, int, bytes]  #: to whom, from whom, what


class ExternalSwarm(Swarm):
    """The drones of ``core``, which has one world.

    Attributes:
        carried: what reached somebody in the last tick, in the order of the medium.
    """

    def __init__(self, core: WorldCore) -> None:
        self._core, agents = core, core.shape[1]
        self._position, self._velocity = core.position[0].copy(), core.velocity[0].copy()
        self._claim = core.claim[0].astype(np.int64)
        self._waiting = [deque[tuple[bytes, bytes]](maxlen=_MOST_WAITING) for _ in range(agents)]
        self._said: list[dict[int, bytes]] = [{} for _ in range(core.ring)]  # by tick, and by whom
        self._accounts: list[tuple[int, AgentStatus]] = []
        self.carried: list[Carried] = []

    def is_at(self, agent: int, position: tuple[float, float], velocity: tuple[float, float]) -> None:
        """Where this drone is now [m, m/s], in the mission's frame."""
        self._position[agent], self._velocity[agent] = position, velocity

    def says(self, agent: int, data: bytes, afar: bytes) -> None:
        """This drone broadcasts something, of which ``afar`` is heard beyond the reach of the mission's radio."""
        self._waiting[agent].append((data, afar))

    def tells(self, agent: int, status: AgentStatus) -> None:
        """This drone gives an account of its slots; from now on it claims the slot that it says it holds."""
        self._accounts.append((agent, status))
        self._claim[agent] = status.slot

    def settle(self) -> None:
        """Put all where they are."""
        self._core.position[0], self._core.velocity[0] = self._position, self._velocity

    def ask(self, tick: int, inbox: Inbox) -> Answers:
        core, said = self._core, self._said
        sent_bytes = np.zeros(core.shape[1], np.int64)
        now = said[tick % len(said)]
        now.clear()
        beyond: list[Carried] = []
        for agent, waiting in enumerate(self._waiting):
            if waiting:
                now[agent], afar = waiting.popleft()
                sent_bytes[agent] = len(now[agent])
                beyond += [(to, agent, afar) for to in self._afar(agent, tick)]
        self.carried = beyond + [
            (to, source, said[sent % len(said)][source])
            for to in range(core.shape[1])
            for source, sent in inbox.arrived[inbox.start[to] : inbox.start[to + 1]].tolist()
        ]
        self.settle()
        accounts, self._accounts = sorted(self._accounts, key=lambda account: account[0]), []
        return Answers(np.zeros((core.shape[1], 2)), sent_bytes, self._claim, accounts)

    def _afar(self, agent: int, tick: int) -> list[int]:
        """Who hears this drone though the mission's radio does not reach there."""
        core, mission = self._core, self._core.missions[0]
        group, loss = core.condition.group[0], float(core.condition.loss[0])
        away = np.linalg.norm(self._position - self._position[agent], axis=1)
        return [
            to
            for to in np.flatnonzero(away > mission.radio.range_m).tolist()
            if not dropped_by(loss, mission.seed, agent, to, tick, bool(group[agent] == group[to]), False)
        ]

    def strike(self, event: object) -> None:
        """Only the radio is the world's."""

    def struck_off(self, row: int) -> None:
        """It goes on flying, and is heard no more."""

    def farewell(self) -> list[tuple[int, AgentStatus]]:
        return []
