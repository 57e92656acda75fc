"""The plain rule "highest version wins", kept to be compared with `protocols.slots.agreement`.

The rules
    1. The proposer exchanges the two slots at once, asks nobody, and raises the version by one.
    2. Notes carry the whole assignment with (version, initiator), for as long as unlike digests are heard.
    3. Whoever hears a larger (version, initiator) adopts the assignment whole. Of two concurrent swaps,
       however far apart, one is lost.

Everybody is trusted: one liar that says a high version places all drones as it likes.
"""

from __future__ import annotations

import struct
from collections.abc import Hashable, Sequence
from dataclasses import replace
from hashlib import blake2b

from protocols.slots.agreement import IllegalSwap, Stance
from protocols.slots.history import is_permutation
from protocols.slots.notes import Assignment, SlotNote
from protocols.slots.seals import Seals
from protocols.slots.settings import SwapCounts, SwapRules
from protocols.slots.written import pack_slots


class VersionedParty:
    """One agent's endpoint, used as `SlotParty` is; no seals are asked for.

    `counts.undone` counts adoptions that put this agent back to where it was before its own latest swap.
    """

    def __init__(
        self,
        me: int,
        initial: Sequence[int],
        rules: SwapRules,
        nonce: int = 0,
        amnesiac: bool = False,
        seals: Seals | None = None,
    ) -> None:
        if not 0 <= me < len(initial) or not is_permutation(initial):
            raise ValueError(f"no agent {me} in an assignment {initial}")
        self.me = me
        self.slot_of = tuple(initial)
        self.stance = Stance.AMNESIAC if amnesiac else Stance.IDLE
        self.counts = SwapCounts()
        self._rules = rules
        self._version = self._initiator = 0
        self._ready_at = 0  # tick
        self._repeat_left = 0
        self._former_slot: int | None = None
        self.digest = self._hash()

    def __copy__(self) -> VersionedParty:
        twin = VersionedParty.__new__(VersionedParty)
        twin.__dict__.update(self.__dict__)
        twin.counts = replace(self.counts)
        return twin

    def state_key(self, tick: int = 0) -> Hashable:
        """All that decides what I do next, times counted from `tick`."""
        return (self.stance, self._key(), max(self._ready_at - tick, 0), self._repeat_left)

    @property
    def view(self) -> Sequence[int]:
        """As `SlotParty.view`."""
        return self.slot_of

    @property
    def slot(self) -> int:
        """My slot."""
        return self.slot_of[self.me]

    @property
    def quiet(self) -> bool:
        """True if nothing is under way."""
        return self._repeat_left == 0 and self.stance is Stance.IDLE

    def ready(self, tick: int) -> bool:
        """True if I may propose now."""
        return self.stance is Stance.IDLE and tick >= self._ready_at

    def propose(self, partner: int, tick: int) -> None:
        """Exchange slots with `partner`, at once. IllegalSwap if cooling down or amnesiac."""
        if not self.ready(tick):
            raise IllegalSwap(f"pausing until tick {self._ready_at}")
        self._exchange(partner, tick)
        self.counts.proposed += 1
        self.counts.committed += 1

    def may_vacate(self, dead: int) -> bool:
        """Anybody may but an amnesiac."""
        return self.stance is not Stance.AMNESIAC

    def vacate(self, dead: int, tick: int) -> None:
        """Take a dead agent's slot and leave it mine, at once. IllegalSwap if amnesiac."""
        if not self.may_vacate(dead):
            raise IllegalSwap("cannot vacate while amnesiac")
        self._exchange(dead, tick)
        self.counts.vacated += 1

    def hear(self, note: SlotNote, sender: int, tick: int) -> None:
        """A neighbour's note."""
        if sender == self.me or (note.digest == self.digest and not note.amnesiac and self.quiet):
            return
        heard = note.whole
        if heard is not None and (heard.version, heard.initiator, heard.slot_of) > self._key():
            self.counts.undone += heard.slot_of[self.me] == self._former_slot
            self.slot_of, self._version, self._initiator = heard
            self._former_slot = None
            self._spread()
        if heard is not None and not note.amnesiac and note.digest == self.digest:
            self.stance = Stance.IDLE
        if note.digest != self.digest or note.amnesiac:
            self._repeat_left = self._rules.repair_frames

    def advance(self, tick: int) -> None:
        """Nothing waits here."""

    def note(self, tick: int) -> SlotNote:
        """What my next broadcast frame says. Counts as said."""
        amnesiac = self.stance is Stance.AMNESIAC
        if self._repeat_left == 0 or amnesiac:
            return SlotNote(self.digest, settled=True, amnesiac=amnesiac)
        self._repeat_left -= 1
        whole = Assignment(self.slot_of, self._version, self._initiator)
        return SlotNote(self.digest, settled=True, whole=whole)

    def _exchange(self, other: int, tick: int) -> None:
        if other == self.me or not 0 <= other < len(self.slot_of):
            raise IllegalSwap(f"agent {self.me} cannot exchange slots with {other}")
        slots = list(self.slot_of)
        self._former_slot = slots[self.me]
        slots[self.me], slots[other] = slots[other], slots[self.me]
        self.slot_of, self._version, self._initiator = tuple(slots), self._version + 1, self.me
        self._ready_at = tick + self._rules.cooldown_ticks
        self._spread()

    def _key(self) -> tuple[int, int, tuple[int, ...]]:
        return (self._version, self._initiator, self.slot_of)

    def _spread(self) -> None:
        self.digest = self._hash()
        self._repeat_left = self._rules.repair_frames

    def _hash(self) -> int:
        text = struct.pack("<2q", self._version, self._initiator) + pack_slots(self.slot_of)
        return int.from_bytes(blake2b(text, digest_size=8).digest(), "little")
