"""How two agents agree to exchange slots.

`SlotParty` is one agent's side. It hears its neighbours' notes and says its own, one in every broadcast
frame. Frames may be lost, doubled, delayed or reordered, so a note repeats what holds instead of announcing
changes.

The rules
    1. A swap is proposed, accepted, committed. The proposer names both slots as it sees them. The one asked
       accepts if it is free, not cooling down and sees the same two slots; else it refuses at once.
    2. A party is in one deal at a time. `TURNS` lists what it may do when; anything else raises `IllegalSwap`
       and changes nothing.
    3. The proposer commits when it hears the acceptance of its pending proposal, and of no other. It acts at
       once; its partner acts when the swap reaches it, from anybody. The swap counts more than any other that the
       proposer knew when it asked and its partner when it accepted, so each agent's swaps are ordered as it went
       through them, and unless a promise times out or a slot is vacated, none that was acted on is ever undone.
       The partner names the counter and puts its seal on the whole swap, the proposer its own when it commits: of
       one consent there is one swap.
    4. If two propose to each other, the lower id gives up its own proposal and accepts the other's.
    5. A proposal is given up after `answer_ticks`; a promise after `lock_ticks`, which is longer, so that a
       commit of the last moment still finds the promise. Either ends early when the party sees one of the two
       slots change hands, or when the other side says that the deal is off.
    6. After a commit both parties cool down, or the partner could swap straight back. A proposer whose
       proposal came to nothing pauses before the next.
    7. The dead cannot answer: whoever takes a dead agent's slot commits alone (`vacate`). If two do, the
       order of swaps decides. Only the follower of a slot may take it, and each agent `MAX_TAKEN` times.
    8. An amnesiac agrees to nothing before it has caught up. The nonces of its swaps begin with the number of
       its boot, so it never uses a swap's name again. A dead agent's slot it may take all the same: a taking undoes no swap
       that two agreed to, whatever its agent has forgotten, and nobody else may be left to take it.
    9. Who lets promises made to it time out, or asks anew instead of committing, cannot keep its partner: a promise is
       renewed for `lock_ticks` at most, and after one has timed out its proposer is refused for `cooldown_ticks`.

What everybody learns, and how, is the subject of `protocols.slots.gossip`.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from copy import copy
from dataclasses import replace

from protocols.slots.deal import TURNS, Deal, IllegalSwap, Stance
from protocols.slots.gossip import NO_NEWS, SlotGossip
from protocols.slots.history import MAX_LEAP, MAX_TAKEN, SlotBook, Swap, pack_swap
from protocols.slots.notes import MAX_REFUSALS, QUIET, Acceptance, Proposal, Refusal, SlotNote, decode, encode
from protocols.slots.seals import Sealed, Seals, Stamps
from protocols.slots.settings import SwapCounts, SwapRules

__all__ = ["IllegalSwap", "SlotNote", "SlotParty", "Stance", "SwapCounts", "SwapRules", "decode", "encode"]

_NONCES_PER_BOOT = 1 << 24


class SlotParty:
    """One agent's endpoint of the swap protocol: a state machine that is told the tick and draws no lots.

    `initial[agent]` is the slot an agent starts in. `nonce` is the number of this boot: a restarted agent is
    given a larger one than before, and `amnesiac=True`. `seals` are this agent's; without, stamps that are good enough within one
    process. `copy.copy` gives an independent twin.

    To read: `stance`, `counts`.
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
        if not 0 <= me < len(initial):
            raise ValueError(f"no agent {me} among {len(initial)}")
        self.me = me
        self.stance = Stance.AMNESIAC if amnesiac else Stance.IDLE
        self.counts = SwapCounts()
        self._rules = rules
        self._seals = seals or Stamps(me)
        self._gossip = SlotGossip(me, initial, rules, self._seals, amnesiac)
        self._deal: Deal | None = None
        self._next_nonce = nonce * _NONCES_PER_BOOT
        self._given_up = -1  # nonce of my latest proposal that came to nothing
        self._cool_until = 0  # tick
        self._retry_at = 0  # tick
        self._refusals: tuple[Refusal, ...] = ()
        self._shunned, self._shun_until = -1, 0  # who let its promise time out; tick
        self._acting: tuple[Swap, ...] = ()  # swaps that moved me

    def __copy__(self) -> SlotParty:
        twin = SlotParty.__new__(SlotParty)
        twin.__dict__.update(self.__dict__)
        twin.counts, twin._gossip = replace(self.counts), copy(self._gossip)
        return twin

    def state_key(self, tick: int = 0) -> Hashable:
        """All that decides what I do next, times counted from `tick`: parties of equal mind behave alike."""
        deal = self._deal
        return (
            self.stance,
            deal and deal._replace(since=deal.since - tick, until=deal.until - tick),
            self._next_nonce,
            self._given_up,
            max(self._cool_until - tick, 0),
            max(self._retry_at - tick, 0),
            self._refusals,
            self._shunned if self._shun_until > tick else -1,
            max(self._shun_until - tick, 0),
            self._gossip.state_key(tick),
        )

    @property
    def digest(self) -> int:
        """64 bits, equal for equal knowledge."""
        return self._gossip.book.digest

    @property
    def slot_of(self) -> tuple[int, ...]:
        """Agent -> slot."""
        return self.book.slot_of

    @property
    def view(self) -> Sequence[int]:
        """As `slot_of`, to be read before the party hears or does more."""
        return self.book.view

    @property
    def slot(self) -> int:
        """My slot."""
        return self.book.view[self.me]

    @property
    def book(self) -> SlotBook:
        """What I know of the swaps; to read only."""
        return self._gossip.book

    @property
    def deal(self) -> Deal | None:
        """What I am engaged in."""
        return self._deal

    @property
    def quiet(self) -> bool:
        """True if nothing is under way: then hearing a quiet note of my digest changes nothing."""
        return self._deal is None and not self._refusals and self._gossip.quiet

    def ready(self, tick: int) -> bool:
        """True if I may propose now."""
        free = self.stance is Stance.IDLE and tick >= self._cool_until and tick >= self._retry_at
        return free and not self._full

    def propose(self, partner: int, tick: int) -> None:
        """Ask `partner` to exchange slots with me. IllegalSwap if engaged, cooling down or amnesiac."""
        self._check_other(partner, "propose")
        if self._full:
            raise IllegalSwap(f"agent {self.me} knows of as many swaps as there may be")
        if not self.ready(tick):
            raise IllegalSwap(f"pausing until tick {max(self._cool_until, self._retry_at)}")
        nonce = self._name()
        self._turn("propose")
        until = tick + self._rules.answer_ticks
        slots = self.slot, partner, self.view[partner]
        self._deal = Deal(self.me, nonce, *slots, self.book.clock, 0, b"", tick, until)
        self.counts.proposed += 1

    def may_vacate(self, dead: int) -> bool:
        """True if this agent may take that one's slot now, if it is dead."""
        slots = self.view
        op = Swap(1, self.me, 0, slots[self.me], dead, slots[dead], taken=True)
        free = (self.stance, "vacate") in TURNS
        return free and self._rules.allows(op) and len(self.book.taken_by(self.me)) < MAX_TAKEN

    def vacate(self, dead: int, tick: int) -> None:
        """Take a dead agent's slot and leave it mine, at once. IllegalSwap if engaged, or if it may not."""
        self._check_other(dead, "vacate")
        if not self.may_vacate(dead):
            raise IllegalSwap(f"agent {self.me} may not take the slot of {dead}")
        slots, counter = self.view, self.book.counter_of_taking(self.me, dead)
        op = Swap(counter, self.me, self._name(), slots[self.me], dead, slots[dead], taken=True)
        self._commit(Sealed(op, self._seals.seal(pack_swap(op))), tick)
        self.counts.vacated += 1

    def hear(self, note: SlotNote, sender: int, tick: int) -> None:
        """A neighbour's note."""
        gossip, book, amnesiac = self._gossip, self._gossip.book, self._gossip.amnesiac
        if note.digest == book.digest and note[2:] == QUIET and not amnesiac:
            if note.settled and book.settled < book.count:
                gossip.hear(note, sender, self.counts)
            return
        if sender == self.me:
            return
        self.advance(tick)
        known, settled = book.digest, book.settled
        gossip.hear(note, sender, self.counts)
        if amnesiac and not gossip.amnesiac:
            self._turn("join")
        if book.digest != known or book.settled != settled:
            self._look_again(tick)
        for answer in note.refusals:
            self._hear_refusal(answer, sender, tick)
        if note.acceptance is not None and note.acceptance.proposer == self.me:
            self._hear_acceptance(note.acceptance, sender, tick)
        if note.proposal is not None and note.proposal.partner == self.me:
            self._weigh(note.proposal, sender, tick)

    def advance(self, tick: int) -> None:
        """Let time pass: what has waited too long is given up."""
        if self._deal is not None and tick >= self._deal.until:
            self.counts.timed_out += 1
            if self.stance is Stance.PROMISED:
                self._shun(self._deal.proposer, tick)
            self._part(tick)

    def note(self, tick: int) -> SlotNote:
        """What my next broadcast frame says. Counts as said."""
        news = self._gossip.say(tick)
        deal = self._deal
        amnesiac = self._gossip.amnesiac
        settled = self.book.settled == self.book.count
        if news is NO_NEWS and deal is None and not self._refusals and not amnesiac:
            return SlotNote(self.digest, settled)
        proposal = acceptance = None
        if deal is not None and self.stance is Stance.PROPOSING:
            proposal = Proposal(deal.partner, deal.nonce, deal.slot, deal.partner_slot, deal.clock)
        elif deal is not None:
            acceptance = Acceptance(deal.proposer, deal.nonce, deal.counter, deal.seal)
        refusals, self._refusals = self._refusals, ()
        return SlotNote(self.digest, settled, amnesiac, proposal, acceptance, refusals, *news)

    def _check_other(self, other: int, event: str) -> None:
        if other == self.me or not 0 <= other < len(self.view):
            raise IllegalSwap(f"agent {self.me} cannot exchange slots with {other}")
        if (self.stance, event) not in TURNS:
            raise IllegalSwap(f"cannot {event} while {self.stance.value}")

    def _turn(self, event: str) -> None:
        self.stance = TURNS[self.stance, event]

    def _name(self) -> int:
        """A nonce I never used before."""
        self._next_nonce += 1
        return self._next_nonce

    @property
    def _full(self) -> bool:
        return self.book.count >= self._rules.history_max

    def _commit(self, swap: Sealed, tick: int) -> None:
        """Act on a swap of mine."""
        self._deal = None
        self._gossip.commit(swap)
        self._cool_until = tick + self._rules.cooldown_ticks
        self._look_again(tick)

    def _shun(self, proposer: int, tick: int) -> None:
        self._shunned, self._shun_until = proposer, tick + self._rules.cooldown_ticks

    def _part(self, tick: int) -> None:
        """The deal is off."""
        if self.stance is Stance.PROPOSING and self._deal is not None:
            self._given_up = self._deal.nonce
            self._retry_at = tick + self._rules.retry_ticks
            self._turn("give up")
        else:
            self._turn("let go")
        self._deal = None

    def _refuse(self, proposer: int, nonce: int) -> None:
        answer = Refusal(proposer, nonce)
        if answer not in self._refusals and len(self._refusals) < MAX_REFUSALS:
            self._refusals = (*self._refusals, answer)

    def _hear_refusal(self, answer: Refusal, sender: int, tick: int) -> None:
        deal = self._deal
        if deal is None or answer != (deal.proposer, deal.nonce):
            return
        if self.stance is Stance.PROPOSING and sender == deal.partner:
            self.counts.refused += 1
            self._part(tick)
        elif self.stance is Stance.PROMISED and sender == deal.proposer:
            self._part(tick)

    def _hear_acceptance(self, answer: Acceptance, sender: int, tick: int) -> None:
        deal, counter = self._deal, answer.counter
        if deal is not None and answer[:2] == (deal.proposer, deal.nonce) and sender == deal.partner:
            op = deal.swap(counter)
            text = pack_swap(op)
            leaps = not deal.clock < counter <= self.book.clock + MAX_LEAP
            if leaps or not self._seals.holds(sender, text, answer.seal):
                self.counts.unsealed += 1
                return
            self._turn("commit")
            self._commit(Sealed(op, self._seals.seal(text) + answer.seal), tick)
            self.counts.committed += 1
        elif answer.nonce == self._given_up:
            self._refuse(self.me, answer.nonce)  # release whoever is promised to what I gave up

    def _weigh(self, proposal: Proposal, sender: int, tick: int) -> None:
        deal, slots = self._deal, self.view
        renewed = self.stance is Stance.PROMISED and deal is not None and deal.proposer == sender
        if renewed and deal is not None and proposal.nonce <= deal.nonce:
            return  # the one I promised, or one before it that is late
        crossing = self.stance is Stance.PROPOSING and deal is not None and deal.partner == sender
        if crossing and self.me > sender:
            return  # mine stands, the sender will yield
        since = deal.since if renewed and deal is not None else tick
        free = self.stance is Stance.IDLE or crossing or (renewed and tick < since + self._rules.lock_ticks)
        agreed = slots[sender] == proposal.slot and slots[self.me] == proposal.partner_slot
        shunned = sender == self._shunned and tick < self._shun_until
        leaps = proposal.clock > self.book.clock + MAX_LEAP
        if not (free and agreed and tick >= self._cool_until) or shunned or leaps or self._full:
            self._refuse(sender, proposal.nonce)
            return
        if self._deal is not None:
            self.counts.withdrawn += crossing
            self._part(tick)
        self._turn("accept")
        until = tick + self._rules.lock_ticks
        counter = 1 + max(proposal.clock, self.book.clock)
        deal = Deal(
            sender, proposal.nonce, proposal.slot, self.me, proposal.partner_slot,
            proposal.clock, counter, b"", since, until,
        )  # fmt: skip
        self._deal = deal._replace(seal=self._seals.seal(pack_swap(deal.swap(counter))))
        self.counts.accepted += 1

    def _look_again(self, tick: int) -> None:
        """After the view may have changed: what becomes of my deal, and of the swaps I acted on."""
        self._count_undone()
        deal = self._deal
        if deal is None:
            return
        if self.stance is Stance.PROMISED and deal.swap(deal.counter) in self.book:
            self._turn("see commit")
            self._deal = None
            self._cool_until = tick + self._rules.cooldown_ticks
        elif self.view[deal.proposer] != deal.slot or self.view[deal.partner] != deal.partner_slot:
            if self.stance is Stance.PROMISED:
                self._refuse(deal.proposer, deal.nonce)
            else:
                self.counts.withdrawn += 1
            self._part(tick)

    def _count_undone(self) -> None:
        book = self.book
        mine = (op for op in book.swaps_of(self.me) if op not in book.skipped)
        acting = () if self.stance is Stance.AMNESIAC else tuple(mine)
        self.counts.undone += sum(op not in acting for op in self._acting)
        self._acting = acting
