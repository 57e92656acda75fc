"""How everybody learns of every swap.

The rules
    1. A swap just learned goes out in the next frame, with its seals; one that lacks a seal is not learned. Whoever hears
       a digest unlike its own repeats its open swaps, newest first and then in rotation, until a few frames after it last
       heard one.
    2. While swaps are open, notes say who is known to have had exactly the sender's swaps. What all have had is settled:
       it need not be told any more. Without news of who has had them the notes fall silent, but for one frame every
       `ack_ticks`. These notes too carry open swaps: who lacks one may hear without being heard, so that nobody hears
       its digest. Whoever hears a settled note of its own digest settles too.
    3. Settled is a matter of quiet, not of memory: a swap that comes late is put in its place among the settled ones, and
       while unlike digests are heard every frame carries a settled swap too, in rotation. So whoever says falsely what
       others have had delays what they learn, and no more.
    4. An amnesiac has joined when two neighbours that remember have had its digest (of two agents, one): then one of them
       is honest, and it knows all that this one knew. Until then it keeps no account of who has had its swaps, and
       whoever hears it fills its frames with the whole history.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import NamedTuple

from protocols.slots.history import SlotBook, Swap
from protocols.slots.notes import SlotNote
from protocols.slots.seals import Sealed, Seals
from protocols.slots.settings import SwapCounts, SwapRules

_WITNESSES = 2


class News(NamedTuple):
    """The part of a note that spreads knowledge."""

    ops: tuple[Sealed, ...] = ()
    had: int = 0


NO_NEWS = News()


class SlotGossip:
    """One agent's knowledge of the swaps, and what it has yet to tell."""

    def __init__(
        self, me: int, initial: Sequence[int], rules: SwapRules, seals: Seals, amnesiac: bool
    ) -> None:
        self.book = SlotBook(initial)
        self.amnesiac = amnesiac
        self._me, self._rules, self._seals = me, rules, seals
        self._sealed: dict[Swap, Sealed] = {}  # by swap, all that are known
        self._had = 0 if amnesiac else 1 << me  # bit k: agent k has had exactly my swaps
        self._witnesses: frozenset[int] = frozenset()  # who remember, and had an amnesiac's swaps
        self._fresh: tuple[Swap, ...] = ()  # learned, not yet told
        self._repair_left = 0  # notes that are still to carry swaps
        self._teach_left = 0  # notes that are still to be filled with swaps for an amnesiac
        self._tally_left = 0  # notes that are still to say who has had them
        self._tally_at = 0  # tick
        self._open_cursor = 0
        self._settled_cursor = 0

    def __copy__(self) -> SlotGossip:
        twin = SlotGossip.__new__(SlotGossip)
        twin.__dict__.update(self.__dict__)
        twin.book, twin._sealed = self.book.copy(), dict(self._sealed)
        return twin

    def state_key(self, tick: int) -> Hashable:
        """All that decides what I do next, times counted from `tick`."""
        return (
            self.amnesiac,
            self.book.ops,
            self.book.settled,
            self._had,
            self._witnesses,
            self._fresh,
            self._repair_left,
            self._teach_left,
            self._tally_left,
            max(self._tally_at - tick, 0),
            self._open_cursor,
            self._settled_cursor,
        )

    @property
    def quiet(self) -> bool:
        """True if I have nothing to tell and nothing left to settle."""
        return not (
            self.book.settled < self.book.count or self._repair_left or self._teach_left or self.amnesiac
        )

    def commit(self, swap: Sealed) -> None:
        """Add a swap of my own."""
        self._enter((swap,))

    def hear(self, note: SlotNote, sender: int, counts: SwapCounts) -> None:
        """Merge what a neighbour says."""
        book = self.book
        if note.digest != book.digest or self.amnesiac:
            self._learn(note.ops, counts)
        unlike = note.digest != book.digest
        if unlike:
            self._repair_left = self._rules.repair_frames
        elif self.amnesiac:
            if not note.amnesiac:
                self._hear_witness(sender)
        elif note.settled:
            book.settle()
        else:
            self._hear_who_had(note.had)
        if note.amnesiac and not self.amnesiac:
            self._teach_left = self._rules.repair_frames

    def say(self, tick: int) -> News:
        """What the next note tells; counts as told."""
        rules, book = self._rules, self.book
        repairing, teaching = self._repair_left > 0, self._teach_left > 0
        tallying = bool(book.settled < book.count and rules.ack_frames and not self.amnesiac) and (
            self._tally_left > 0 or tick >= self._tally_at
        )
        if not (repairing or teaching or tallying):
            return NO_NEWS
        settled_ones = rules.repair_per_frame if teaching else int(repairing)
        ops = self._pick(settled_ones)
        self._repair_left -= repairing
        self._teach_left -= teaching
        if tallying:
            self._tally_left -= self._tally_left > 0
            self._tally_at = tick + rules.ack_ticks
        return News(tuple(map(self._sealed.__getitem__, ops)), self._had if tallying else 0)

    def _learn(self, swaps: tuple[Sealed, ...], counts: SwapCounts) -> None:
        """Of these, what is new and properly sealed."""
        good = []
        for swap in swaps:
            if swap.op in self._sealed:
                continue
            if not (self._rules.allows(swap.op) and swap.holds(self._seals)):
                counts.unsealed += 1
            else:
                good.append(swap)
        if good:
            self._enter(tuple(good))

    def _enter(self, swaps: tuple[Sealed, ...]) -> None:
        new = tuple(swap for swap in swaps if self.book.add(swap.op))
        if not new:
            return
        self._sealed.update((swap.op, swap) for swap in new)
        self._fresh = (*(swap.op for swap in new), *self._fresh)
        if len(self._sealed) > self.book.count:  # one has made room for another
            self._sealed = {op: self._sealed[op] for op in self.book.ops}
            self._fresh = tuple(op for op in self._fresh if op in self._sealed)
        self._repair_left = self._rules.repair_frames
        self._open_cursor = 0
        self._witnesses = frozenset()
        if not self.amnesiac:
            self._start_tally()

    def _start_tally(self) -> None:
        """My swaps changed: as yet I know only of myself that I have had just these."""
        self._had = 1 << self._me
        self._tally_left = self._rules.ack_frames

    def _hear_witness(self, sender: int) -> None:
        self._witnesses |= {sender}
        if len(self._witnesses) >= min(_WITNESSES, len(self.book.view) - 1):
            self.amnesiac, self._witnesses = False, frozenset()
            self._start_tally()

    def _hear_who_had(self, had: int) -> None:
        had |= self._had
        if had != self._had:
            self._had = had
            self._tally_left = self._rules.ack_frames
            if had == (1 << len(self.book.view)) - 1:
                self.book.settle()

    def _pick(self, settled_ones: int) -> tuple[Swap, ...]:
        """The swaps of one note: those just learned, then the other open ones in rotation from the newest, and so many settled
        ones at least, in rotation from the newest."""
        limit, ops, settled = self._rules.repair_per_frame, self.book.ops, self.book.settled
        unsettled, settled_ones = len(ops) - settled, min(settled_ones, settled)
        room = limit - min(settled_ones, 1) if unsettled else 0
        if unsettled <= room:
            picked, self._fresh, self._open_cursor = [*reversed(ops[settled:])], (), 0
        else:
            first = ops[settled]
            fresh = tuple([op for op in self._fresh if op >= first])
            picked, self._fresh = [*fresh[:room]], fresh[room:]
            while len(picked) < room:
                op = ops[-1 - self._open_cursor % unsettled]
                self._open_cursor = (self._open_cursor + 1) % unsettled
                if op not in picked:
                    picked.append(op)
        for _ in range(min(settled_ones, limit - len(picked))):
            picked.append(ops[settled - 1 - self._settled_cursor % settled])
            self._settled_cursor = (self._settled_cursor + 1) % settled
        return tuple(picked)
