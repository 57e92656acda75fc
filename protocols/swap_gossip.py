"""How everybody learns of every swap, and how swaps that all know are put away.

The rules
    1. A swap just learned goes out in the next frame. Whoever hears a digest unlike its own repeats its open
       swaps, newest first and then in rotation, until a few frames after it last heard one.
    2. While swaps are open, notes carry acknowledgements in rotation: who has had exactly which swaps. What
       all have had is folded: no older swap can still come, as an agent's later swaps count more than any it
       acknowledged. Acknowledgements that bring no news fall silent, but for one frame every `ack_ticks`.
    3. Whoever hears of a larger checkpoint that is a prefix of its own swaps folds that far. A settled note
       of the same digest is such a checkpoint. Who is behind and cannot is sent the checkpoint and adopts it.
    4. The dead acknowledge nothing. Of more than `open_max` open swaps the older half is folded regardless.
    5. An amnesiac has joined when it has heard a neighbour's checkpoint and then an equal digest.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import NamedTuple

from protocols.slots import Checkpoint, Mark, SlotBook, Swap
from protocols.swap_notes import Ack, SlotNote
from protocols.swap_rules import SwapCounts, SwapRules

_LOW32 = (1 << 32) - 1


class News(NamedTuple):
    """The part of a note that spreads knowledge."""

    mark: Mark | None = None
    ops: tuple[Swap, ...] = ()
    acks: tuple[Ack, ...] = ()
    checkpoint: Checkpoint | None = None


NO_NEWS = News()


class SlotGossip:
    """One agent's knowledge of the swaps, and what it has yet to tell."""

    def __init__(self, me: int, initial: Sequence[int], rules: SwapRules, boot: int, amnesiac: bool) -> None:
        self.book = SlotBook(initial)
        self.amnesiac = amnesiac
        self._me, self._rules, self._boot = me, rules, boot
        self._acks: tuple[Ack | None, ...] = (None,) * len(initial)
        self._turn = 0  # how often my own acknowledgement changed
        self._primed = False  # an amnesiac that has heard a checkpoint
        self._fresh: tuple[Swap, ...] = ()  # learned, not yet told
        self._repair_left = 0  # notes that are still to carry swaps
        self._chat_left = 0  # notes that are still to carry acknowledgements
        self._ack_due = 0  # tick
        self._op_cursor = 0
        self._ack_cursor = 0
        self._lending = False  # the next note carries my checkpoint
        if not amnesiac:
            self._acknowledge()

    def __copy__(self) -> SlotGossip:
        twin = SlotGossip.__new__(SlotGossip)
        twin.__dict__.update(self.__dict__)
        twin.book = self.book.copy()
        return twin

    def mind(self, tick: int) -> Hashable:
        """All that decides what I do next, times counted from `tick`."""
        return (
            self.amnesiac,
            self.book.base,
            self.book.open,
            self._acks,
            self._turn,
            self._primed,
            self._fresh,
            self._repair_left,
            self._chat_left,
            max(self._ack_due - tick, 0),
            self._op_cursor,
            self._ack_cursor,
            self._lending,
        )

    @property
    def quiet(self) -> bool:
        """True if I have nothing to tell and nothing left to fold."""
        return not (self.book.open or self._repair_left or self._lending or self.amnesiac)

    def commit(self, op: Swap, counts: SwapCounts) -> None:
        """Add a swap of my own."""
        self._learn((op,), counts)

    def hear(self, note: SlotNote, counts: SwapCounts) -> None:
        """Merge what a neighbour says."""
        book = self.book
        digest = book.digest
        self._learn(note.ops, counts)
        if note.checkpoint is not None:
            self._primed = True
            if book.adopt(note.checkpoint) and not self.amnesiac:
                counts.adopted += 1
        elif note.mark is not None and note.mark > book.base.mark and book.has_prefix(note.mark):
            book.fold(note.mark.size)
        unlike = note.digest != book.digest
        if note.settled and not unlike:
            book.fold(book.count)
        if self.amnesiac and self._primed and not note.amnesiac and not unlike:
            self.amnesiac = False
            self._acknowledge()
        elif book.digest != digest:
            self._acknowledge()
        self._hear_acks(note.acks)
        if unlike:
            self._repair_left = self._rules.repair_frames
        behind = unlike and note.mark is not None and note.mark < book.base.mark
        if (note.amnesiac or behind) and not self.amnesiac:
            self._lending = True

    def say(self, tick: int) -> News:
        """What the next note tells; counts as told."""
        rules, book = self._rules, self.book
        repairing = self._repair_left > 0
        chatting = bool(book.open and rules.acks_per_frame and not self.amnesiac) and (
            self._chat_left > 0 or tick >= self._ack_due
        )
        if not (repairing or chatting or self._lending or self.amnesiac):
            return NO_NEWS
        ops: tuple[Swap, ...] = ()
        acks: tuple[Ack, ...] = ()
        checkpoint = book.base if self._lending else None
        self._lending = False
        if repairing:
            ops = self._pick_ops()
            self._repair_left = max(self._repair_left - 1, 1 if self._fresh else 0)
        if chatting:
            acks = self._pick_acks()
            self._chat_left = max(self._chat_left - 1, 0)
            self._ack_due = tick + rules.ack_ticks
        return News(book.base.mark, ops, acks, checkpoint)

    def _learn(self, ops: tuple[Swap, ...], counts: SwapCounts) -> None:
        book = self.book
        new = tuple(op for op in ops if book.add(op))
        if not new:
            return
        self._fresh = (*new, *self._fresh)
        self._repair_left = self._rules.repair_frames
        self._op_cursor = 0
        self._acknowledge()
        if len(book.open) > self._rules.open_max and book.fold(book.base.size + len(book.open) // 2):
            counts.forced += 1

    def _acknowledge(self) -> None:
        """My own acknowledgement, after my swaps changed."""
        if self.amnesiac:
            return
        self._turn += 1
        book = self.book
        mine = Ack(self._me, self._boot, self._turn, book.count, book.digest & _LOW32)
        self._acks = (*self._acks[: self._me], mine, *self._acks[self._me + 1 :])
        self._chat()
        self._fold_what_all_had()

    def _hear_acks(self, acks: tuple[Ack, ...]) -> None:
        known = list(self._acks)
        for ack in acks:
            held = known[ack.agent]
            newer = held is None or (ack.boot, ack.turn) > (held.boot, held.turn)
            if newer and ack.agent != self._me:
                known[ack.agent] = ack
        if tuple(known) != self._acks:
            self._acks = tuple(known)
            self._chat()
            self._fold_what_all_had()

    def _chat(self) -> None:
        """Send every acknowledgement I know twice more."""
        others = self._rules.acks_per_frame - 1
        self._chat_left = 2 * -(-len(self._acks) // others) if others > 0 else 0

    def _fold_what_all_had(self) -> None:
        book = self.book
        if not book.open or not self._rules.acks_per_frame:
            return
        size = book.count
        for ack in self._acks:
            digest = None if ack is None else book.prefix_digest(ack.size)
            if ack is None or digest is None or digest & _LOW32 != ack.digest32:
                return
            size = min(size, ack.size)
        book.fold(size)

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

    def _pick_acks(self) -> tuple[Ack, ...]:
        """My own acknowledgement and the next few of the others'."""
        n = len(self._acks)
        known = [ack for i in range(n) if (ack := self._acks[(self._ack_cursor + i) % n]) is not None]
        others = [ack for ack in known if ack.agent != self._me][: self._rules.acks_per_frame - 1]
        if others:
            self._ack_cursor = (others[-1].agent + 1) % n
        return (*(ack for ack in known if ack.agent == self._me), *others)
