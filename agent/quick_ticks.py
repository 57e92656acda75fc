"""The thin shell around agent.quick: one drone's ticks in a relayed world."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from agent.body.relayed import RelayedWorld
from agent.core import AgentCore
from agent.policy.asking import raised
from agent.policy.base import Compiled
from agent.quick import Quick
from agent.radio.hearing import Hearing
from protocols.kernels import by_reference
from protocols.wire.messages import MAX_FROM_DRONE, with_account
from protocols.wire.rows import as_bytes
from protocols.wire.status import AgentStatus, is_due


def account_of(core: AgentCore, hearing: Hearing, tick: int) -> AgentStatus:
    """The account of itself that a drone of one gives after this tick."""
    return core.status(0, tick, tuple(hearing.rejected.values()))


class QuickTicks:
    """Ticks of one drone in a relayed world, answered in one call.

    telling: (1,) whether they tell of plans, to those who look on.
    """

    def __init__(self, core: AgentCore, hearing: Hearing, world: RelayedWorld) -> None:
        self._core, self._hearing, self._world = core, hearing, world
        self._last, self._size = np.full(1, -1), np.zeros(1, np.int64)
        self._answer = np.zeros(MAX_FROM_DRONE, np.uint8)
        self._answer_bytes, self._last_tick, self._asked = self._answer.data, self._last.data, self._size.data
        self._data: NDArray[np.uint8] | None = None  # where kernels read a Tick
        self._fly: Callable[[], int] | None = None
        self.telling = np.zeros(1, np.bool_)

    def _connect(self) -> None:
        core, sensed, world = self._core, self._world.sensed, self._world
        self._data, self._into, policy = world.heard, world.heard.data, core.policy
        if isinstance(policy, Compiled):
            quick = Quick(
                world.process, self._size, core.arrays, self._hearing.ears(world.heard),
                as_bytes(sensed.position), as_bytes(sensed.velocity), as_bytes(sensed.near),
                as_bytes(sensed.obstacles), core.command, as_bytes(core.command), world.commands, self._last,
                self._answer, self.telling,
            )  # fmt: skip
            self._fly = policy.quickly(by_reference(quick))

    def flown(self, tick: int) -> None:
        """This tick was flown in the ordinary way."""
        self._last_tick[0] = tick
        if self._data is not self._world.heard:  # now all is there that a tick works on
            self._connect()

    @property
    def last(self) -> int:
        """The last tick that was flown, in whatever way."""
        return self._last_tick[0]

    def answer(self, message: bytes) -> bytes | None:
        """The Reply to this Tick, which is also the world's; None where it is to be done in the ordinary way."""
        size = len(message)
        if self._fly is None or size > len(self._into):
            return None
        self._asked[0] = size
        self._into[:size] = message
        try:
            size = self._fly()
        except Exception as error:
            raise raised(self._core.mission.policy, error) from error
        if size < 0:
            return None
        tick, status, reply = self._last_tick[0], None, self._answer_bytes[:size].tobytes()
        if is_due(tick, changed=False):
            status = account_of(self._core, self._hearing, tick)
            reply = with_account(reply, status)
        self._world.answered(tick, reply, status)
        return reply
