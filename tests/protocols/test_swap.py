"""The swap protocol, one story per rule: how two agree, and what overtakes them."""

from __future__ import annotations

import pytest

from protocols.slots.agreement import IllegalSwap, SlotNote, SlotParty, Stance, SwapRules
from protocols.slots.history import pack_swap
from protocols.slots.notes import Acceptance, Refusal
from protocols.slots.seals import Stamps
from tests.protocols.swap_parties import RULES, parties, rounds, tell


def test_propose_accept_commit() -> None:
    a, b = parties(2)
    a.propose(1, tick=0)
    tell(a, b)
    assert b.stance is Stance.PROMISED
    assert (a.slot, b.slot) == (0, 1), "nobody acts before the commit"
    tell(b, a)
    assert (a.slot, b.slot) == (1, 1), "the proposer acts first"
    tell(a, b)
    assert (a.slot, b.slot) == (1, 0)
    assert (a.counts.proposed, a.counts.committed, b.counts.accepted) == (1, 1, 1)
    assert a.stance is b.stance is Stance.IDLE


def test_who_is_engaged_refuses_at_once() -> None:
    a, b, _ = parties(3)
    a.propose(1, tick=0)
    b.propose(2, tick=0)
    tell(a, b)
    tell(b, a)
    assert a.stance is Stance.IDLE
    assert a.counts.refused == 1
    assert not a.ready(9), "a pause before the next try"
    assert a.ready(10)


@pytest.mark.parametrize("answer", ["acceptance", "refusal"])
def test_only_the_one_asked_can_answer(answer: str) -> None:
    a, b, c = parties(3)
    a.propose(1, tick=0)
    assert a.deal is not None
    for agent in (c, b):  # each with a seal of its own
        assert a.stance is Stance.PROPOSING
        note = SlotNote(agent.digest, settled=True)
        if answer == "acceptance":
            seal = Stamps(agent.me).seal(pack_swap(a.deal.swap(1)))
            note = note._replace(acceptance=Acceptance(a.me, a.deal.nonce, 1, seal))
        else:
            note = note._replace(refusals=(Refusal(a.me, a.deal.nonce),))
        a.hear(note, agent.me, tick=1)
    assert (a.counts.committed, a.counts.refused) == ((1, 0) if answer == "acceptance" else (0, 1))


def test_only_the_proposer_releases_whom_it_asked() -> None:
    a, b, c = parties(3)
    a.propose(1, tick=0)
    tell(a, b)
    assert b.deal is not None
    off = SlotNote(c.digest, settled=True, refusals=(Refusal(a.me, b.deal.nonce),))
    b.hear(off, c.me, tick=1)
    assert b.stance is Stance.PROMISED
    b.hear(off, a.me, tick=1)
    assert b.stance is Stance.IDLE


def test_a_party_is_in_one_deal_at_a_time() -> None:
    a, b, c = parties(3)
    a.propose(1, tick=0)
    c.propose(1, tick=0)
    tell(a, b)
    tell(c, b)
    tell(b, a, c)
    assert a.counts.committed == 1
    assert c.counts.refused == 1


@pytest.mark.parametrize("act", ["propose", "vacate"])
@pytest.mark.parametrize("stance", ["proposing", "promised", "amnesiac", "with itself", "with nobody"])
def test_an_illegal_event_raises_and_changes_nothing(stance: str, act: str) -> None:
    if (stance, act) == ("amnesiac", "vacate"):
        return  # that is what it may do
    a, b, _ = parties(3)
    other = {"with itself": 0, "with nobody": 3}.get(stance, 2)
    if stance == "proposing":
        a.propose(1, tick=0)
    elif stance == "promised":
        b.propose(0, tick=0)
        tell(b, a)
    elif stance == "amnesiac":
        a = SlotParty(0, range(3), RULES, nonce=1, amnesiac=True)
    before = a.state_key()
    with pytest.raises(IllegalSwap):
        getattr(a, act)(other, tick=0)
    assert a.state_key() == before


def test_both_cool_down_after_a_commit() -> None:
    a, b, c = parties(3)
    a.propose(1, tick=0)
    tell(a, b)
    tell(b, a)
    tell(a, b, c)
    for party in (a, b):
        assert not party.ready(99)
        assert party.ready(100)
        with pytest.raises(IllegalSwap, match="until tick 100"):
            party.propose(2, tick=99)
    c.propose(0, tick=50)
    tell(c, a, tick=50)
    tell(a, c, tick=50)
    assert c.counts.refused == 1


def test_unlike_views_of_the_slots_are_refused() -> None:
    a, b, c = parties(3)
    c.vacate(1, tick=0)  # a has not heard of it
    tell(c, b)
    a.propose(1, tick=0)
    tell(a, b)
    assert b.stance is Stance.IDLE
    tell(b, a)
    assert a.stance is Stance.IDLE
    assert a.counts.withdrawn + a.counts.refused == 1


@pytest.mark.parametrize("first", [0, 1])
def test_of_two_crossing_proposals_the_higher_ids_stands(first: int) -> None:
    swarm = parties(2)
    swarm[0].propose(1, tick=0)
    swarm[1].propose(0, tick=0)
    notes = [party.note(0) for party in swarm]
    for listener in (first, 1 - first):
        swarm[listener].hear(notes[1 - listener], 1 - listener, 0)
    rounds(swarm, 2)
    assert [party.slot for party in swarm] == [1, 0]
    assert [party.counts.committed for party in swarm] == [0, 1]
    assert swarm[0].counts.withdrawn == 1
    assert swarm[0].book.count == 1, "one swap, not two"


def test_a_proposal_times_out_and_a_stale_acceptance_commits_nothing() -> None:
    a, b = parties(2)
    a.propose(1, tick=0)
    tell(a, b)
    stale = b.note(0)
    a.advance(49)
    assert a.stance is Stance.PROPOSING
    a.advance(50)
    assert a.stance is Stance.IDLE
    a.propose(1, tick=60)
    a.hear(stale, 1, 60)
    assert a.stance is Stance.PROPOSING
    assert a.slot == 0


def test_an_acceptance_that_comes_too_late_sets_the_promised_free() -> None:
    a, b = parties(2)
    a.propose(1, tick=0)
    tell(a, b)
    a.advance(50)
    tell(b, a, tick=51)
    tell(a, b, tick=52)
    assert b.stance is Stance.IDLE
    assert (a.slot, b.slot) == (0, 1)


def test_a_time_out_counts_though_nobody_told_the_party_the_time() -> None:
    a, b = parties(2)
    a.propose(1, tick=0)
    tell(a, b)
    tell(b, a, tick=50)
    assert a.slot == 0


def test_a_promise_times_out() -> None:
    a, b = parties(2)
    a.propose(1, tick=0)
    tell(a, b)
    b.advance(99)
    assert b.stance is Stance.PROMISED
    b.advance(100)
    assert b.stance is Stance.IDLE
    assert b.counts.timed_out == 1


def test_a_doubled_or_late_proposal_is_no_second_one() -> None:
    a, b = parties(2)
    a.propose(1, tick=0)
    proposal = a.note(0)
    b.hear(proposal, 0, 0)
    b.hear(proposal, 0, 0)
    assert b.counts.accepted == 1
    tell(b, a)
    tell(a, b)
    b.hear(proposal, 0, 200)  # much later: the slots have changed hands
    assert b.stance is Stance.IDLE


def test_the_swap_itself_proves_the_commit_whoever_brings_it() -> None:
    a, b, c = parties(3)
    a.propose(1, tick=0)
    tell(a, b)
    tell(b, a)
    tell(a, c)
    tell(c, b)
    assert b.slot == 0
    assert b.stance is Stance.IDLE


def test_a_proposal_is_dropped_when_another_swap_overtakes_it() -> None:
    a, _, c = parties(3)
    a.propose(1, tick=0)
    c.vacate(1, tick=0)
    tell(c, a)
    assert a.stance is Stance.IDLE
    assert a.counts.withdrawn == 1


def test_a_promise_is_let_go_when_another_swap_overtakes_it() -> None:
    a, b, c = parties(3)
    a.propose(1, tick=0)
    tell(a, b)
    c.vacate(0, tick=0)
    tell(c, b)
    assert b.stance is Stance.IDLE
    assert tell(b, a).refusals == (Refusal(0, 1),)


def test_a_swap_counts_more_than_all_that_either_party_knows() -> None:
    """c has missed that a and b swapped and swapped back: it sees the same slots as a, but a knows more."""
    a, b, c = parties(3, SwapRules(cooldown_ticks=0))
    for proposer, partner in ((a, b), (b, a)):
        proposer.propose(partner.me, tick=0)
        tell(proposer, partner)
        tell(partner, proposer)
        tell(proposer, partner)
    for _ in range(10):
        tell(a, b)  # until a no longer repeats its swaps
    c.propose(0, tick=0)
    tell(c, a)
    acceptance = a.note(0)._replace(ops=())
    c.hear(acceptance, 0, 0)
    assert c.book.open[-1].counter == 3
    rounds([a, b, c], 2)
    assert c.counts.undone == 0
    assert (a.slot, b.slot, c.slot) == (2, 1, 0)
