"""Who occupies which slot.

The slot tree is fixed by the mission. What changes is the occupant of each slot, and only a swap changes it.

The rules
    1. A swap exchanges two slots' occupants and names both of them. It is never edited or removed.
    2. Swaps are totally ordered by (counter, initiator, nonce). The counter is a Lamport clock: a new swap
       counts one more than the largest counter its initiator knows. No initiator uses a nonce twice.
    3. The view is the fold of all known swaps, in that order, over the initial assignment. A swap whose named
       occupants no longer hold the named slots is skipped. Hence every set of swaps gives a permutation, and
       equal sets give equal views, in whatever order they were heard.
    4. The oldest swaps may be folded into a checkpoint. It ends between two counters, never inside one. From
       then on a swap that counts no more than the checkpoint's clock is ignored: it is in it, or lost.
    5. The digest is a sum of one hash for each swap ever known, so folding does not change it.
    6. Of two checkpoints the one with the larger (size, digest) prevails. Whoever holds the other first looks
       whether the larger one is a prefix of its own swaps: if so it folds that far and its view stays; if not
       it adopts it whole, and of its own swaps keeps those beyond the checkpoint's clock.
"""

from __future__ import annotations

import struct
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from hashlib import blake2b
from typing import NamedTuple

from protocols.wire.keys import MAX_AGENTS

_MASK = (1 << 64) - 1


class Swap(NamedTuple):
    """The occupants of two slots change places. Tuples compare in the swaps' total order."""

    counter: int
    initiator: int
    nonce: int
    slot_a: int
    agent_a: int
    slot_b: int
    agent_b: int

    def involves(self, agent: int) -> bool:
        return agent in (self.agent_a, self.agent_b)


class Mark(NamedTuple):
    """The name of a checkpoint. Of two marks the larger tuple prevails."""

    size: int
    digest: int


class Checkpoint(NamedTuple):
    """Swaps already folded: the view they give, their digest, their largest counter and their number."""

    slot_of: tuple[int, ...]
    digest: int
    clock: int
    size: int

    @property
    def mark(self) -> Mark:
        return Mark(self.size, self.digest)


def hash_swap(op: Swap) -> int:
    """64 bits that are the same on every machine (Python's own hash is not)."""
    return int.from_bytes(blake2b(struct.pack("<7q", *op), digest_size=8).digest(), "little")


def is_permutation(numbers: Sequence[int]) -> bool:
    return sorted(numbers) == list(range(len(numbers)))


class SlotBook:
    """One agent's knowledge of the swaps. All its values are immutable, so `copy` is cheap.

    `initial[agent]` is the slot an agent starts in: any permutation.

    To read: `slot_of` (agent -> slot) and `occupant` (slot -> agent) are the current fold; `digest`, 64 bits;
    `open`, the swaps not yet in the checkpoint `base`, in order; `skipped`, those of them the fold skips.
    """

    _sums: tuple[int, ...]  # _sums[i] is the digest of the checkpoint and the first i open swaps
    base: Checkpoint
    digest: int
    occupant: tuple[int, ...]
    open: tuple[Swap, ...]
    skipped: frozenset[Swap]
    slot_of: tuple[int, ...]

    def __init__(self, initial: Sequence[int]) -> None:
        if not 0 < len(initial) <= MAX_AGENTS or not is_permutation(initial):
            raise ValueError(f"not an assignment of at most {MAX_AGENTS} agents to as many slots: {initial}")
        digest = int.from_bytes(blake2b(bytes(initial), digest_size=8).digest(), "little")
        self._start_from(Checkpoint(tuple(initial), digest, clock=0, size=0), ())

    @property
    def clock(self) -> int:
        """The largest counter known."""
        return self.open[-1].counter if self.open else self.base.clock

    @property
    def count(self) -> int:
        """How many swaps are known, those in the checkpoint included."""
        return self.base.size + len(self.open)

    def copy(self) -> SlotBook:
        twin = SlotBook.__new__(SlotBook)
        twin.__dict__.update(self.__dict__)
        return twin

    def add(self, op: Swap) -> bool:
        """Learn of a swap; True if it is new. ValueError, and no change, if it names what does not exist."""
        self._check(op)
        if op.counter <= self.base.clock:
            return False
        if not self.open or op > self.open[-1]:
            self._append(op)
            return True
        at = bisect_left(self.open, op)
        if self.open[at] == op:
            return False
        self._start_from(self.base, (*self.open[:at], op, *self.open[at:]))
        return True

    def prefix_digest(self, count: int) -> int | None:
        """Digest of the first `count` swaps; None where the checkpoint begins later or fewer are known."""
        index = count - self.base.size
        return self._sums[index] if 0 <= index < len(self._sums) else None

    def has_prefix(self, mark: Mark) -> bool:
        """True if a checkpoint of this name holds exactly my first swaps and ends between two counters."""
        if self.prefix_digest(mark.size) != mark.digest:
            return False
        return self._ends_cleanly(mark.size - self.base.size)

    def fold(self, count: int) -> int:
        """Move the first `count` swaps into the checkpoint, fewer if that would part equal counters.

        Returns how many moved. View, digest, clock and count stay as they are.
        """
        index = min(count - self.base.size, len(self.open))
        while index > 0 and not self._ends_cleanly(index):
            index -= 1
        if index <= 0:
            return 0
        done, self.open = self.open[:index], self.open[index:]
        slot_of = self.slot_of
        if self.open:
            occupant = list(_inverse(self.base.slot_of))
            _replay(occupant, done)
            slot_of = _inverse(occupant)
        self.base = Checkpoint(slot_of, self._sums[index], done[-1].counter, self.base.size + index)
        self._sums = self._sums[index:]
        self.skipped = self.skipped.difference(done)
        return index

    def adopt(self, checkpoint: Checkpoint) -> bool:
        """Take over a checkpoint that prevails over mine; one that does not changes nothing.

        True if it was no prefix of my swaps, so that some of mine up to its clock may be lost.
        """
        if len(checkpoint.slot_of) != len(self.slot_of) or not is_permutation(checkpoint.slot_of):
            raise ValueError("a checkpoint is a permutation of the same agents")
        if checkpoint.mark <= self.base.mark:
            return False
        if self.has_prefix(checkpoint.mark):
            self.fold(checkpoint.size)
            return False
        self._start_from(checkpoint, tuple(op for op in self.open if op.counter > checkpoint.clock))
        return True

    def _check(self, op: Swap) -> None:
        n = len(self.slot_of)
        named = (op.initiator, op.slot_a, op.agent_a, op.slot_b, op.agent_b)
        if not all(0 <= number < n for number in named):
            raise ValueError(f"no such agent or slot among {n}: {op}")
        if op.slot_a == op.slot_b or op.agent_a == op.agent_b or op.counter < 1 or op.nonce < 0:
            raise ValueError(f"not a swap: {op}")

    def _ends_cleanly(self, index: int) -> bool:
        return index in (0, len(self.open)) or self.open[index - 1].counter < self.open[index].counter

    def _append(self, op: Swap) -> None:
        """The common case: the swap comes after all known ones, so the fold goes on from where it stands."""
        self.open = (*self.open, op)
        self.digest = (self.digest + hash_swap(op)) & _MASK
        self._sums = (*self._sums, self.digest)
        occupant = list(self.occupant)
        if _replay(occupant, (op,)):
            self.skipped = self.skipped | {op}
        else:
            self.occupant = tuple(occupant)
            self.slot_of = _inverse(occupant)

    def _start_from(self, base: Checkpoint, ops: tuple[Swap, ...]) -> None:
        self.base, self.open = base, ops
        sums = [base.digest]
        for op in ops:
            sums.append((sums[-1] + hash_swap(op)) & _MASK)
        self._sums, self.digest = tuple(sums), sums[-1]
        occupant = list(_inverse(base.slot_of))
        self.skipped = frozenset(_replay(occupant, ops))
        self.occupant = tuple(occupant)
        self.slot_of = _inverse(occupant)


def _replay(occupant: list[int], ops: Iterable[Swap]) -> list[Swap]:
    """Fold ordered swaps into `occupant` in place; returns those that were skipped."""
    skipped = []
    for op in ops:
        if occupant[op.slot_a] == op.agent_a and occupant[op.slot_b] == op.agent_b:
            occupant[op.slot_a], occupant[op.slot_b] = op.agent_b, op.agent_a
        else:
            skipped.append(op)
    return skipped


def _inverse(permutation: Sequence[int]) -> tuple[int, ...]:
    inverse = [0] * len(permutation)
    for index, value in enumerate(permutation):
        inverse[value] = index
    return tuple(inverse)
