"""The thin shell around agent.quick: one drone's ticks in a relayed world."""

import numpy as np
from numpy.typing import NDArray

from agent.body.relayed import RelayedWorld
from agent.core import AgentCore
from agent.policy.base import Compiled
from agent.quick import Quick
from agent.radio.hearing import Hearing
from protocols.kernels import by_reference
from protocols.wire.messages import MAX_FROM_DRONE
from protocols.wire.rows import as_bytes


class QuickTicks:
    """Ticks of one drone in a relayed world, answered in one call."""

    def __init__(self, core: AgentCore, hearing: Hearing, world: RelayedWorld) -> None:
        self._core, self._hearing, self._world = core, hearing, world
        self._last = np.full(1, -1)
        self._answer = np.zeros(MAX_FROM_DRONE, np.uint8)
        self._answer_bytes, self._last_tick = self._answer.data, self._last.data
        self._data: NDArray[np.uint8] | None = None

    def _connect(self) -> None:
        core, sensed, world = self._core, self._world.sensed, self._world
        self._data, self._into = world.heard, world.heard.data
        self._quick = by_reference(
            Quick(
                world.process, core.arrays, self._hearing.ears(world.heard), as_bytes(sensed.position),
                as_bytes(sensed.velocity), as_bytes(sensed.near), as_bytes(sensed.obstacles), core.command,
                as_bytes(core.command), world.commands, self._last, self._answer,
            )
        )  # fmt: skip

    def flown(self, tick: int) -> None:
        """This tick was flown in the ordinary way."""
        self._last_tick[0] = tick

    @property
    def last(self) -> int:
        """The last tick that was flown, in whatever way."""
        return self._last_tick[0]

    def answer(self, message: bytes) -> tuple[int, bytes] | None:
        """The tick, and the Reply to this Tick; None where it is to be done in the ordinary way."""
        policy, world = self._core.policy, self._world
        first = self._last_tick[0] < 0  # then not all that a tick works on is there
        if not isinstance(policy, Compiled) or first or len(message) > len(world.heard):
            return None
        if self._data is not world.heard:
            self._connect()
        self._into[: len(message)] = message
        size = policy.fly(len(message), self._quick)
        return None if size < 0 else (self._last_tick[0], self._answer_bytes[:size].tobytes())
