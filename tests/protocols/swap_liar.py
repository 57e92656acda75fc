"""A party that says anything, to whom it likes.

It has a login like everybody's, so it seals what it likes in its own name, and what it hears it keeps: the consents that it
was given, the swaps of others and their seals, whole notes. It has no other's key.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from swap_net import Swarm

from protocols.slots.agreement import SlotNote, Stance
from protocols.slots.history import MAX_LEAP, Swap, pack_swap
from protocols.slots.notes import Acceptance, Assignment, Proposal, Refusal
from protocols.slots.seals import SEAL_BYTES, Sealed, Stamps

LIES = (
    "ask", "accept", "refuse", "cash in", "cash in twice", "take", "take back", "forge", "strip", "alter", "replay", "had",
    "whole", "digest",
)  # fmt: skip


class Consent(NamedTuple):
    """An honest agent's seal on a swap with the liar, to be used now, later or never."""

    op: Swap
    seal: bytes


class Liar:
    """What the liar of `swarm` knows, and the lies it can make up from it."""

    def __init__(self, swarm: Swarm) -> None:
        assert swarm.liar is not None
        self.me, self._swarm = swarm.liar, swarm
        self._seals = Stamps(self.me)
        self.asked: dict[tuple[int, int], Proposal] = {}  # (partner, nonce)
        self.consents: list[Consent] = []
        self.made: list[Sealed] = []  # properly sealed by it, told to some or to none
        self.heard: list[SlotNote] = []
        self._nonce = 1000

    def listen(self) -> None:
        """Hear what everybody would say now, and whom they are promised to."""
        for party in self._swarm.honest:
            deal = party.deal
            if deal is not None and party.stance is Stance.PROMISED and deal.proposer == self.me:
                consent = Consent(deal.swap(deal.counter), deal.seal)
                if consent not in self.consents:
                    self.consents.append(consent)

    def hear(self, note: SlotNote) -> None:
        """Keep a note for later."""
        if not note.quiet and len(self.heard) < 30:
            self.heard.append(note)

    def lie(self, kind: str, numbers: Sequence[int]) -> SlotNote:
        """One lie; `numbers` choose among what can be said of this kind."""
        self.listen()
        a, b, c = numbers
        n = self._swarm.n
        listener = self._swarm.endpoints[a % n]
        digest = (listener.digest, 0, self._swarm.endpoints[b % n].digest)[c % 3]
        note = SlotNote(digest, settled=bool(c & 4), amnesiac=c % 11 == 0)
        said = getattr(self, "_" + kind.replace(" ", "_"))(note, a, b, c)
        assert isinstance(said, SlotNote)
        return said

    def _slots(self, other: int) -> tuple[int, ...]:
        return self._swarm.endpoints[other].slot_of

    def _clock(self, other: int, choice: int) -> int:
        clock = self._swarm.endpoints[other].book.clock
        return (clock, 0, clock + MAX_LEAP, clock + 3, 2**56 - 1, clock + MAX_LEAP + 1)[choice % 6]

    def _other(self, a: int) -> int:
        return (self.me + 1 + a % (self._swarm.n - 1)) % self._swarm.n

    def _ask(self, note: SlotNote, a: int, b: int, c: int) -> SlotNote:
        partner, self._nonce = self._other(a), self._nonce + b % 2
        slots = self._slots(partner)
        mine = slots[self.me] if b % 7 else (slots[self.me] + 1) % self._swarm.n
        proposal = Proposal(partner, self._nonce, mine, slots[partner], self._clock(partner, b))
        return note._replace(proposal=proposal)

    def _accept(self, note: SlotNote, a: int, b: int, c: int) -> SlotNote:
        """Any proposal under way, to whomever it was made."""
        deals = [party.deal for party in self._swarm.honest if party.deal is not None]
        if not deals:
            return note
        deal = deals[a % len(deals)]
        counter = (deal.clock + 1, deal.clock, 2**56 - 1, deal.clock + MAX_LEAP, deal.clock + 5)[b % 5]
        seal = self._seals.seal(pack_swap(deal.swap(counter if c % 5 else 3)))
        return note._replace(acceptance=Acceptance(deal.proposer, deal.nonce, counter, seal))

    def _refuse(self, note: SlotNote, a: int, b: int, c: int) -> SlotNote:
        deals = [party.deal for party in self._swarm.honest if party.deal is not None]
        return note._replace(refusals=tuple(Refusal(deal.proposer, deal.nonce) for deal in deals[:8]))

    def _cash_in(self, note: SlotNote, a: int, b: int, c: int) -> SlotNote:
        if not self.consents:
            return note
        op, seal = self.consents[a % len(self.consents)]
        return self._say(note, op, self._seals.seal(pack_swap(op)) + seal)

    def _cash_in_twice(self, note: SlotNote, a: int, b: int, c: int) -> SlotNote:
        """A consent for one swap under another: at another moment, for another slot or with another name."""
        if not self.consents:
            return note
        op, seal = self.consents[a % len(self.consents)]
        other = (
            op._replace(counter=op.counter + 1 + b),
            op._replace(counter=1),
            op._replace(slot_a=b % self._swarm.n),
            op._replace(nonce=op.nonce + 1),
        )[c % 4]
        return self._say(note, other, self._seals.seal(pack_swap(other)) + seal)

    def _take(self, note: SlotNote, a: int, b: int, c: int) -> SlotNote:
        """The slot of one who lives, now, in the past or in the future."""
        victim = self._other(a)
        slots = self._slots(victim)
        self._nonce += 1
        counter = max(self._clock(victim, b), 1)
        op = Swap(counter, self.me, self._nonce, slots[self.me], victim, slots[victim], taken=True)
        return self._say(note, op, self._seals.seal(pack_swap(op)))

    def _take_back(self, note: SlotNote, a: int, b: int, c: int) -> SlotNote:
        """A taking, dated before what its victim or the liar itself has agreed to since."""
        agreed = [op for party in self._swarm.honest for op in party.book.ops if not op.taken]
        if not agreed:
            return note
        op = agreed[a % len(agreed)]
        victim, slot = ((op.agent_a, op.slot_a), (op.agent_b, op.slot_b))[b % 2]
        if victim == self.me:
            return note
        self._nonce += 1
        mine = next((slot for agent, slot in enumerate(self._slots(victim)) if agent == self.me))
        counter = max(op.counter - c % 2, 1)
        taking = Swap(counter, self.me, self._nonce, mine, victim, slot, taken=True)
        return self._say(note, taking, self._seals.seal(pack_swap(taking)))

    def _forge(self, note: SlotNote, a: int, b: int, c: int) -> SlotNote:
        """A swap of two others, or a taking by another, under no seal of theirs."""
        n = self._swarm.n
        one, two = self._other(a), self._other(a + 1)
        slots = self._slots(one)
        op = Swap(max(self._clock(one, b), 1), one, 1 + c % n, slots[one], two, slots[two], taken=bool(c % 2))
        mine = self._seals.seal(pack_swap(op))
        return note._replace(ops=(Sealed(op, mine if op.taken else mine + mine),))

    def _known(self) -> list[Sealed]:
        return [swap for note in self.heard for swap in note.ops]

    def _strip(self, note: SlotNote, a: int, b: int, c: int) -> SlotNote:
        """A swap of two as though one had taken a slot, and the other way round."""
        if not (known := self._known()):
            return note
        op, seals = known[a % len(known)]
        other = op._replace(taken=not op.taken)
        cut = seals[:SEAL_BYTES] if other.taken else seals + self._seals.seal(pack_swap(other))
        return note._replace(ops=(Sealed(other, cut),))

    def _alter(self, note: SlotNote, a: int, b: int, c: int) -> SlotNote:
        """A swap of others with something changed."""
        if not (known := self._known()):
            return note
        op, seals = known[a % len(known)]
        altered = (
            op._replace(counter=op.counter + 1 + b),
            op._replace(nonce=op.nonce + b),
            op._replace(agent_b=self.me),
        )
        return note._replace(ops=(Sealed(altered[c % 3], seals),))

    def _replay(self, note: SlotNote, a: int, b: int, c: int) -> SlotNote:
        """What another said long ago, as though it were the liar's own word."""
        if not self.heard:
            return note
        said = self.heard[a % len(self.heard)]
        return said if c % 2 else note._replace(ops=said.ops, had=said.had)

    def _had(self, note: SlotNote, a: int, b: int, c: int) -> SlotNote:
        """Everybody has had it, whatever it is."""
        return note._replace(had=(1 << self._swarm.n) - 1 if b % 2 else b % (1 << self._swarm.n))

    def _whole(self, note: SlotNote, a: int, b: int, c: int) -> SlotNote:
        n = self._swarm.n
        return note._replace(whole=Assignment(tuple((slot + b) % n for slot in range(n)), 2**48, a % n))

    def _digest(self, note: SlotNote, a: int, b: int, c: int) -> SlotNote:
        return note

    def _say(self, note: SlotNote, op: Swap, seals: bytes) -> SlotNote:
        swap = Sealed(op, seals)
        if swap.holds(self._seals) and swap not in self.made:
            self.made.append(swap)
        return note._replace(ops=(swap,))
