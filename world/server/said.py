"""What the drones have said: their answers to the tick that is flown, and their frames for as long as they can still arrive."""

from operator import itemgetter
from typing import Any

import numpy as np

from protocols.wire.frames import MAX_FRAME_BYTES
from protocols.wire.messages import Reply
from protocols.wire.rows import bytes_of
from protocols.wire.status import AgentStatus
from world.core import Answers, WorldCore
from world.server.questions import empty_frames


class Said:
    """By the N drones of one world. Who says nothing keeps its command and its slot.

    Attributes:
        command: (N, 2) [m/s^2]. frames: what they sent.
    """

    def __init__(self, core: WorldCore) -> None:
        self._agents, self._ring, self._first = core.shape[1], core.ring, 0
        self.frames = empty_frames(core)
        self.command, self._sent_bytes = np.zeros((self._agents, 2)), np.zeros(self._agents, np.int64)
        self._claim = core.claim[0].astype(np.int64)
        # The same numbers, to be filled one by one.
        self._command_of: memoryview[Any] = self.command.data
        self._sent_bytes_of, self._claim_of = self._sent_bytes.data, self._claim.data
        self._frame_of, self._size_of = bytes_of(self.frames.data), self.frames.size.reshape(-1).data
        self._accounts: list[tuple[int, AgentStatus]] = []

    def begin(self, tick: int) -> None:
        """What is said from now on answers to this tick."""
        self._first = tick % self._ring * self._agents
        self._accounts.clear()
        self._sent_bytes[:] = 0

    def take(self, agent: int, reply: Reply) -> None:
        """This drone answers."""
        self._command_of[agent, 0], self._command_of[agent, 1] = reply.ax, reply.ay
        self._claim_of[agent] = reply.slot
        if reply.status is not None:
            self._accounts.append((agent, reply.status))
        if reply.frame is not None:
            place, size = self._first + agent, len(reply.frame)
            self._frame_of[place * MAX_FRAME_BYTES : place * MAX_FRAME_BYTES + size] = reply.frame
            self._size_of[place] = self._sent_bytes_of[agent] = size

    def answers(self) -> Answers:
        """All of it."""
        in_order = sorted(
            self._accounts, key=itemgetter(0)
        )  # those of one drone as they came: it may catch up
        return Answers(self.command, self._sent_bytes, self._claim, in_order)
