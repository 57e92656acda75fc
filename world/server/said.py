"""What the drones have said: their answers to the tick that is flown, and their frames for as long as they can still arrive."""

from typing import Any

import numpy as np

from protocols.wire.messages import Reply
from protocols.wire.status import AgentStatus
from world.core import Answers, Inbox, WorldCore


class Said:
    """By the N drones of one world. Who says nothing keeps its command and its slot.

    Attributes:
        command: (N, 2) [m/s^2].
    """

    def __init__(self, core: WorldCore) -> None:
        agents = core.shape[1]
        self._ring, self._tick = core.ring, 0
        self._frames: list[list[bytes]] = [[b""] * agents for _ in range(core.ring)]
        self.command, self._sent_bytes = np.zeros((agents, 2)), np.zeros(agents, np.int64)
        self._claim = core.claim[0].astype(np.int64)
        # The same numbers, to be filled one by one.
        self._command_of: memoryview[Any] = self.command.data
        self._sent_bytes_of, self._claim_of = self._sent_bytes.data, self._claim.data
        self._accounts: list[tuple[int, AgentStatus]] = []

    def begin(self, tick: int) -> None:
        """What is said from now on answers to this tick."""
        self._tick = tick
        self._accounts.clear()
        self._sent_bytes[:] = 0

    def take(self, agent: int, reply: Reply) -> None:
        """This drone answers."""
        self._command_of[agent, 0], self._command_of[agent, 1] = reply.ax, reply.ay
        self._claim_of[agent] = reply.slot
        if reply.status is not None:
            self._accounts.append((agent, reply.status))
        if reply.frame is not None:
            self._frames[self._tick % self._ring][agent] = reply.frame
            self._sent_bytes_of[agent] = len(reply.frame)

    def frames(self, inbox: Inbox) -> list[bytes]:
        """What arrives now."""
        return [self._frames[sent % self._ring][source] for source, sent in inbox.arrived.tolist()]

    def answers(self) -> Answers:
        """All of it."""
        return Answers(self.command, self._sent_bytes, self._claim, sorted(self._accounts))
