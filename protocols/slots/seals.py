"""Seals: what shows a third party that an agent agreed to a swap.

A swap that two agreed to carries the seals of both over the whole of it; a slot taken from the dead that of the taker. So a
history can be repeated by anybody and forged by nobody.
"""

from __future__ import annotations

from functools import lru_cache
from hashlib import blake2b
from typing import NamedTuple, Protocol

from protocols.slots.history import Swap, pack_swap

SEAL_BYTES = 64


class Seals(Protocol):
    """One agent's own seal, and how it knows those of others."""

    def seal(self, text: bytes) -> bytes:
        """`SEAL_BYTES` that show that this agent stands by `text`."""

    def holds(self, agent: int, text: bytes, seal: bytes) -> bool:
        """True if `agent` made this seal over just this text."""


class Stamps:
    """Seals for agents that share one process, as in a simulation, and so could not keep a key from each other.

    As long as a real one, and hundreds of times quicker. Whoever can run this code can forge them.
    """

    def __init__(self, me: int) -> None:
        self._me = me

    def seal(self, text: bytes) -> bytes:
        return _stamp(self._me, text)

    def holds(self, agent: int, text: bytes, seal: bytes) -> bool:
        return seal == _stamp(agent, text)


@lru_cache(maxsize=1024)  # as each of a thousand drones looks at every swap
def _stamp(agent: int, text: bytes) -> bytes:
    return blake2b(text, key=b"agent-%d" % agent, digest_size=SEAL_BYTES).digest()


class Sealed(NamedTuple):
    """A swap with the seal of agent_a, followed, unless it was `taken`, by that of agent_b."""

    op: Swap
    seals: bytes

    def holds(self, seals: Seals) -> bool:
        """True if everybody whose consent it needs has sealed it."""
        text, op = pack_swap(self.op), self.op
        if len(self.seals) != (SEAL_BYTES if op.taken else 2 * SEAL_BYTES):
            return False
        by_a, by_b = self.seals[:SEAL_BYTES], self.seals[SEAL_BYTES:]
        return seals.holds(op.agent_a, text, by_a) and (op.taken or seals.holds(op.agent_b, text, by_b))
