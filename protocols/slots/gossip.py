"""How everybody learns of every swap, and how swaps that all know are put away.

The rules
    1. A swap just learned goes out in the next frame. Whoever hears a digest unlike its own repeats its open
       swaps, newest first and then in rotation, until a few frames after it last heard one.
    2. While swaps are open, notes say who is known to have had exactly the sender's swaps. What all have had
       is folded: no older swap can still come, as an agent's later swaps count more than any it has had.
       Without news of who has had them the notes fall silent, but for one frame every `ack_ticks`. These notes
       too carry open swaps: who lacks one may hear without being heard, so that nobody hears its digest.
    3. Whoever hears a settled note of its own digest folds too: the sender knew that all have had them. Who
       has unlike swaps and a smaller checkpoint is sent the larger one, and takes it over.
    4. The dead learn nothing. Of more than `open_max` open swaps the older half is folded regardless.
    5. An amnesiac has joined when it has heard a neighbour's checkpoint and then an equal digest. Until then its swaps
       are on their way to somebody else's, and it keeps no account of who has had them.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import NamedTuple

from protocols.slots.history import Checkpoint, Mark, SlotBook, Swap
from protocols.slots.notes import SlotNote
from protocols.slots.settings import SwapCounts, SwapRules


class News(NamedTuple):
    """The part of a note that spreads knowledge."""

    mark: Mark | None = None
    ops: tuple[Swap, ...] = ()
    had: int = 0
    checkpoint: Checkpoint | None = None


NO_NEWS = News()


class SlotGossip:
    """One agent's knowledge of the swaps, and what it has yet to tell."""

    def __init__(self, me: int, initial: Sequence[int], rules: SwapRules, amnesiac: bool) -> None:
        self.book = SlotBook(initial)
        self.amnesiac = amnesiac
        self._me, self._rules = me, rules
        self._had = 0 if amnesiac else 1 << me  # bit k: agent k has had exactly my swaps
        self._primed = False  # an amnesiac that has heard a checkpoint
        self._fresh: tuple[Swap, ...] = ()  # learned, not yet told
        self._repair_left = 0  # notes that are still to carry swaps
        self._tally_left = 0  # notes that are still to say who has had them
        self._tally_at = 0  # tick
        self._op_cursor = 0
        self._lending = False  # the next note carries my checkpoint

    def __copy__(self) -> SlotGossip:
        twin = SlotGossip.__new__(SlotGossip)
        twin.__dict__.update(self.__dict__)
        twin.book = self.book.copy()
        return twin

    def state_key(self, tick: int) -> Hashable:
        """All that decides what I do next, times counted from `tick`."""
        return (
            self.amnesiac,
            self.book.base,
            self.book.open,
            self._had,
            self._primed,
            self._fresh,
            self._repair_left,
            self._tally_left,
            max(self._tally_at - tick, 0),
            self._op_cursor,
            self._lending,
        )

    @property
    def quiet(self) -> bool:
        """True if I have nothing to tell and nothing left to fold."""
        return not (self.book.open or self._repair_left or self._lending or self.amnesiac)

    def commit(self, op: Swap, counts: SwapCounts) -> None:
        """Add a swap of my own."""
        self._learn((op,), counts)
        self._start_tally()

    def hear(self, note: SlotNote, counts: SwapCounts) -> None:
        """Merge what a neighbour says."""
        book = self.book
        if note.digest != book.digest or self.amnesiac:
            self._merge(note, counts)
        unlike = note.digest != book.digest
        if self.amnesiac and self._primed and not note.amnesiac and not unlike:
            self.amnesiac = False
            self._start_tally()
        if unlike:
            self._repair_left = self._rules.repair_frames
        elif note.settled:
            book.fold(book.count)
        elif not self.amnesiac:
            self._hear_who_had(note.had)
        behind = unlike and note.mark is not None and note.mark < book.base.mark
        if (note.amnesiac or behind) and not self.amnesiac:
            self._lending = True

    def say(self, tick: int) -> News:
        """What the next note tells; counts as told."""
        rules, book = self._rules, self.book
        repairing = self._repair_left > 0
        tallying = bool(book.open and rules.ack_frames and not self.amnesiac) and (
            self._tally_left > 0 or tick >= self._tally_at
        )
        if not (repairing or tallying or self._lending or self.amnesiac):
            return NO_NEWS
        mark = book.base.mark if repairing or self._lending or self.amnesiac else None
        checkpoint = book.base if self._lending else None
        self._lending = False
        ops: tuple[Swap, ...] = ()
        if repairing or tallying:
            ops = self._pick_ops()
            self._repair_left = max(self._repair_left - 1, 0)
        if tallying:
            self._tally_left = max(self._tally_left - 1, 0)
            self._tally_at = tick + rules.ack_ticks
        return News(mark, ops, self._had if tallying else 0, checkpoint)

    def _merge(self, note: SlotNote, counts: SwapCounts) -> None:
        book, digest = self.book, self.book.digest
        self._learn(note.ops, counts)
        if note.checkpoint is not None:
            self._primed = True
            if book.adopt(note.checkpoint) and not self.amnesiac:
                counts.adopted += 1
        if book.digest != digest and not self.amnesiac:
            self._start_tally()

    def _learn(self, ops: tuple[Swap, ...], counts: SwapCounts) -> None:
        book = self.book
        new = tuple(op for op in ops if book.add(op))
        if not new:
            return
        self._fresh = (*new, *self._fresh)
        self._repair_left = self._rules.repair_frames
        self._op_cursor = 0
        if len(book.open) > self._rules.open_max and book.fold(book.base.size + len(book.open) // 2):
            counts.forced += 1

    def _start_tally(self) -> None:
        """My swaps changed: as yet I know only of myself that I have had just these."""
        self._had = 1 << self._me
        self._tally_left = self._rules.ack_frames

    def _hear_who_had(self, had: int) -> None:
        had |= self._had
        if had != self._had:
            self._had = had
            self._tally_left = self._rules.ack_frames
            if had == (1 << len(self.book.slot_of)) - 1:
                self.book.fold(self.book.count)

    def _pick_ops(self) -> tuple[Swap, ...]:
        """The swaps of one note: first those just learned, then the others in rotation from the newest."""
        limit, ops = self._rules.repair_per_frame, self.book.open
        if len(ops) <= limit:
            self._fresh, self._op_cursor = (), 0
            return ops[::-1]
        unfolded = tuple(op for op in self._fresh if op.counter > self.book.base.clock)
        picked, self._fresh = list(unfolded[:limit]), unfolded[limit:]
        while len(picked) < limit:
            op = ops[-1 - self._op_cursor % len(ops)]
            self._op_cursor = (self._op_cursor + 1) % len(ops)
            if op not in picked:
                picked.append(op)
        return tuple(picked)
