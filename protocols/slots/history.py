"""Who occupies which slot.

The slot tree is fixed by the mission. What changes is the occupant of each slot, and only a swap changes it.

The rules
    1. A swap exchanges two slots' occupants and names both of them. It is never edited. Either both agents agreed to it,
       or one took the slot of another that it held for dead (`taken`).
    2. Swaps are totally ordered by (counter, agent_a, nonce). No agent uses a nonce of its own twice.
    3. The view is the fold of all known swaps, in that order, over the initial assignment. A swap whose named
       occupants no longer hold the named slots is skipped. Hence every set of swaps gives a permutation, and
       equal sets give equal views, in whatever order they were heard.
    4. Who agrees to a swap is not dead. A taken slot is skipped if the next swap that either of its two agents agreed to
       finds that agent where it was before: no vacancy, whenever it is told of, undoes a swap that two agreed to
       without knowing of it.
    5. The digest is a sum of one hash for each swap known.
    6. All swaps are kept: a liar cannot make anybody forget one. For that they must be few. Swaps of two agents are as
       many as the honest agree to; of the slots that one agent took, the first `MAX_TAKEN` in the order are kept.
    7. Nobody agreed to the counter of a taken slot, so one that counts more than `MAX_LEAP` beyond all that
       was agreed is not believed before other swaps have come that far.
"""

from __future__ import annotations

import struct
from array import array
from bisect import bisect_left
from collections.abc import Sequence
from functools import lru_cache
from hashlib import blake2b
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.slots.written import pack_slots

MAX_TAKEN = 16
"""Slots of the dead that one agent may take in a flight."""
MAX_LEAP = 1 << 20
"""How far a counter may be ahead of what an agent knows."""
_MASK = (1 << 64) - 1
_SLOT = "H"  # 16 bits, as `array` has them


class Swap(NamedTuple):
    """The occupants of two slots change places: agent_a, who asked or took, and agent_b. Tuples compare in the total order."""

    counter: int
    agent_a: int
    nonce: int
    slot_a: int
    agent_b: int
    slot_b: int
    taken: bool = False


def pack_swap(op: Swap) -> bytes:
    """The same bytes on every machine: what is hashed, and what is sealed."""
    return struct.pack("<7q", *op)


@lru_cache(maxsize=1024)  # all drones of a process learn of the same swaps
def hash_swap(op: Swap) -> int:
    """64 bits that are the same on every machine (Python's own hash is not)."""
    return int.from_bytes(blake2b(pack_swap(op), digest_size=8).digest(), "little")


def is_permutation(numbers: Sequence[int] | NDArray[np.uint16]) -> bool:
    """Whether they are 0, 1, 2, ... in some order: an assignment that gives every slot to exactly one agent."""
    return bool((np.sort(numbers) == np.arange(len(numbers))).all())


class SlotBook:
    """One agent's knowledge of the swaps.

    `initial[agent]` is the slot an agent starts in: any permutation.

    To read: `view` (agent -> slot), the current fold, which changes with the next swap; `digest`, 64 bits;
    `ops`, all swaps in order; `skipped`, those of them the fold skips; `settled`: so many of the first ones, as far as is known,
    everybody has had (new swaps among them unsettle those after them).
    """

    ops: tuple[Swap, ...]
    settled: int
    digest: int
    view: array[int]
    skipped: frozenset[Swap]
    _initial: array[int]  # agent -> slot
    _agreed_clock: int  # the largest counter two have agreed to
    _takings: int  # so many of `ops` are taken slots
    _swaps_of: dict[int, tuple[Swap, ...]]  # agent -> those that name it, in order
    _last_of: dict[int, Swap]  # slot -> the last that names it

    def __init__(self, initial: Sequence[int]) -> None:
        if not len(initial) or not is_permutation(initial):
            raise ValueError(f"not an assignment of agents to as many slots: {initial}")
        self.digest = int.from_bytes(blake2b(pack_slots(initial), digest_size=8).digest(), "little")
        self._initial, self.settled, self._agreed_clock = array(_SLOT, initial), 0, 0
        self.ops = ()
        self._index_all(())
        self._replay()

    @property
    def slot_of(self) -> tuple[int, ...]:
        """Agent -> slot, as it is now."""
        return tuple(self.view)

    @property
    def clock(self) -> int:
        """The largest counter known."""
        return self.ops[-1].counter if self.ops else 0

    @property
    def count(self) -> int:
        """How many swaps are known."""
        return len(self.ops)

    @property
    def open(self) -> tuple[Swap, ...]:
        """The swaps that are not settled."""
        return self.ops[self.settled :]

    def copy(self) -> SlotBook:
        twin = SlotBook.__new__(SlotBook)
        twin.__dict__.update(self.__dict__)
        twin.view, twin._swaps_of, twin._last_of = self.view[:], dict(self._swaps_of), dict(self._last_of)
        return twin

    def __contains__(self, op: Swap) -> bool:
        at = bisect_left(self.ops, op)
        return self.ops[at : at + 1] == (op,)

    def add(self, op: Swap) -> bool:
        """Learn of a swap; True if the history has changed. ValueError, and no change, if it names what does not exist."""
        self._check(op)
        ops, at = self.ops, bisect_left(self.ops, op)
        if ops[at : at + 1] == (op,) or (op.taken and op.counter > self._agreed_clock + MAX_LEAP):
            return False
        if op.taken and len(taken := self.taken_by(op.agent_a)) >= MAX_TAKEN:
            if op > taken[-1]:
                return False
            ops = tuple(other for other in ops if other != taken[-1])  # which came after this one
            self.digest = (self.digest - hash_swap(taken[-1])) & _MASK
            self._index_all(ops)
        self.digest = (self.digest + hash_swap(op)) & _MASK
        if not op.taken:
            self._agreed_clock = max(self._agreed_clock, op.counter)
        self.settled = min(self.settled, at)
        self.ops = (*ops[:at], op, *ops[at:])
        self._index(op)
        if self._takings or self._last_of[op.slot_a] > op or self._last_of[op.slot_b] > op:
            self._replay()
        else:
            self._go_on(op)
        return True

    def settle(self) -> None:
        """As far as is known everybody has had these swaps."""
        self.settled = len(self.ops)

    def swaps_of(self, agent: int) -> tuple[Swap, ...]:
        """The swaps that name an agent, in order."""
        return self._swaps_of.get(agent, ())

    def taken_by(self, agent: int) -> list[Swap]:
        """The slots of the dead that an agent took, in order."""
        return [op for op in self.swaps_of(agent) if op.taken and op.agent_a == agent]

    def counter_of_taking(self, agent: int, dead: int) -> int:
        """What the taking of a dead agent's slot should count: more than what was agreed, or was taken from these two.

        Not more than whatever is known: else whoever takes with the largest counter possible would keep all others from it.
        """
        taken = [op.counter for op in (*self.swaps_of(agent), *self.swaps_of(dead)) if op.taken]
        return 1 + max([self._agreed_clock, *taken])

    def _check(self, op: Swap) -> None:
        n = len(self._initial)
        named = op.agent_a, op.slot_a, op.agent_b, op.slot_b
        if min(named) < 0 or max(named) >= n:
            raise ValueError(f"no such agent or slot among {n}: {op}")
        if op.slot_a == op.slot_b or op.agent_a == op.agent_b or op.counter < 1 or op.nonce < 0:
            raise ValueError(f"not a swap: {op}")

    def _go_on(self, op: Swap) -> None:
        """The common case: those after the new swap know nothing of its slots, so the fold goes on from where it stands."""
        if not _apply(self.view, op):
            self.skipped |= {op}

    def _replay(self) -> None:
        """Fold all of them from the start."""
        ops, void = self.ops, _void(self.ops)
        self.view = self._initial[:]
        self.skipped = frozenset(op for op in ops if op in void or not _apply(self.view, op))

    def _index_all(self, ops: Sequence[Swap]) -> None:
        """Find these, and no others."""
        self._takings, self._swaps_of, self._last_of = 0, {}, {}
        for op in ops:
            self._index(op)

    def _index(self, op: Swap) -> None:
        """Find this swap by its agents and its slots, too."""
        self._takings += op.taken
        for agent in (op.agent_a, op.agent_b):
            swaps = self.swaps_of(agent)
            at = bisect_left(swaps, op)
            self._swaps_of[agent] = (*swaps[:at], op, *swaps[at:])
        for slot in (op.slot_a, op.slot_b):
            if self._last_of.get(slot, op) <= op:
                self._last_of[slot] = op


def _void(ops: Sequence[Swap]) -> frozenset[Swap]:
    """The takings that the next agreed swap of either agent knows nothing of."""
    found_in: dict[int, int] = {}  # agent -> the slot in which its next agreed swap finds it
    void = []
    for op in reversed(ops):
        if not op.taken:
            found_in[op.agent_a], found_in[op.agent_b] = op.slot_a, op.slot_b
        elif found_in.get(op.agent_a) == op.slot_a or found_in.get(op.agent_b) == op.slot_b:
            void.append(op)
    return frozenset(void)


def _apply(slot_of: array[int], op: Swap) -> bool:
    """Fold one swap into it in place; False if it is skipped."""
    if slot_of[op.agent_a] != op.slot_a or slot_of[op.agent_b] != op.slot_b:
        return False
    slot_of[op.agent_a], slot_of[op.agent_b] = op.slot_b, op.slot_a
    return True
