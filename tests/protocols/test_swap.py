"""The swap protocol, one story per rule."""

from __future__ import annotations

from copy import copy

import msgpack
import pytest

from protocols.slots.agreement import IllegalSwap, SlotNote, SlotParty, Stance, SwapRules, encode
from protocols.slots.history import MAX_TAKEN, pack_swap
from protocols.slots.notes import Acceptance, Refusal
from protocols.slots.seals import Stamps

RULES = SwapRules()


def parties(n: int, rules: SwapRules = RULES) -> list[SlotParty]:
    return [SlotParty(agent, range(n), rules) for agent in range(n)]


def tell(speaker: SlotParty, *listeners: SlotParty, tick: int = 0) -> SlotNote:
    """One broadcast, heard by these."""
    note = speaker.note(tick)
    for listener in listeners:
        listener.hear(note, speaker.me, tick)
    return note


def rounds(swarm: list[SlotParty], count: int, tick: int = 0) -> None:
    for _ in range(count):
        for speaker in swarm:
            tell(speaker, *(party for party in swarm if party is not speaker), tick=tick)


# Agreement


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
    note = SlotNote(c.digest, settled=True)
    if answer == "acceptance":
        counter = 1
        seal = Stamps(b.me).seal(pack_swap(a.deal.swap(counter)))
        note = note._replace(acceptance=Acceptance(a.me, a.deal.nonce, counter, seal))
    else:
        note = note._replace(refusals=(Refusal(a.me, a.deal.nonce),))
    a.hear(note, c.me, tick=1)
    assert a.stance is Stance.PROPOSING
    a.hear(note, b.me, tick=1)
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


# Closing ranks


def test_a_dead_agents_slot_is_taken_at_once() -> None:
    a, b, c = parties(3)
    b.vacate(0, tick=0)
    assert b.slot == 0
    tell(b, c)
    c.vacate(0, tick=1)
    assert c.slot == 1
    tell(c, a)
    tell(b, a)
    assert a.slot == 2, "back again, the dead one finds itself in the leaf"


def test_if_two_take_one_slot_the_order_decides_and_the_undone_is_counted() -> None:
    _, b, c, d = parties(4)
    b.vacate(0, tick=0)
    c.vacate(0, tick=0)
    rounds([b, c, d], 3)
    assert {party.slot_of for party in (b, c, d)} == {(1, 0, 2, 3)}
    assert (b.counts.undone, c.counts.undone) == (0, 1)


# Gossip


def test_the_quiet_cost_eleven_bytes_and_hear_nothing_new() -> None:
    a, b = parties(2)
    note = tell(a, b)
    assert note.quiet
    assert note.settled
    assert len(msgpack.packb(encode(note))) <= 11
    assert a.quiet
    before = b.state_key()
    tell(a, b)
    assert b.state_key() == before
    assert a.note(5) is a.note(6)


def test_who_missed_a_swap_is_told_after_one_exchange() -> None:
    a, b, c = parties(3)
    a.vacate(1, tick=0)
    for _ in range(9):
        tell(a, b)
    assert not a.note(0).ops, "told often enough"
    tell(c, a)
    tell(a, c)
    assert c.slot_of == a.slot_of


def test_a_merge_of_many_swaps_is_bounded_per_frame() -> None:
    rules = SwapRules(repair_per_frame=2, cooldown_ticks=0, ack_frames=0)
    a, b, *_ = parties(8, rules)
    for _ in range(4):
        for other in (2, 3, 4):
            a.vacate(other, tick=0)
    frames = 0
    while b.digest != a.digest:
        tell(b, a)
        assert len(tell(a, b).ops) <= 2
        frames += 1
    assert frames <= 6 + 1
    assert b.slot_of == a.slot_of


def test_what_all_know_is_settled_and_all_fall_quiet() -> None:
    swarm = parties(6)
    swarm[0].vacate(5, tick=0)
    rounds(swarm, 8)
    assert all(party.quiet for party in swarm)
    assert {(party.book.count, party.book.open) for party in swarm} == {(1, ())}


def test_one_who_does_not_answer_stalls_settling_and_costs_little() -> None:
    swarm = parties(6)
    swarm[0].vacate(5, tick=0)
    rounds(swarm[:5], 60)
    assert all(party.book.open for party in swarm[:5])
    loud = sum(not tell(party, tick=tick).quiet for tick in range(1000, 1100) for party in swarm[:5])
    assert loud <= 5 * 20 + 5, "one frame in five"
    rounds(swarm, 12, tick=2000)
    assert all(party.quiet for party in swarm), "back again, it is no longer waited for"


def test_who_has_had_the_swaps_is_said_again_if_it_was_lost() -> None:
    swarm = parties(3)
    swarm[0].vacate(2, tick=0)
    for _ in range(20):
        for speaker in swarm:
            note = speaker.note(0)._replace(had=0)
            for party in swarm:
                party.hear(note, speaker.me, 0)
    assert all(party.book.open for party in swarm)
    rounds(swarm, 6, tick=50)
    assert all(party.quiet for party in swarm)


def test_who_knows_very_many_swaps_agrees_to_no_more() -> None:
    a, b = parties(2, SwapRules(history_max=1, cooldown_ticks=0))
    a.propose(1, tick=0)
    rounds([a, b], 3)
    assert a.book.count == 1
    assert not a.ready(500)
    with pytest.raises(IllegalSwap, match="as many swaps as there may be"):
        a.propose(1, tick=500)


def test_nobody_takes_more_slots_than_it_may() -> None:
    a, _ = parties(2)
    for _ in range(MAX_TAKEN):
        a.vacate(1, tick=0)
    with pytest.raises(IllegalSwap, match="may not take"):
        a.vacate(1, tick=0)


def test_only_who_follows_a_slot_takes_it() -> None:
    _, b, c = parties(3, SwapRules(leaders=(-1, 0, 1)))
    with pytest.raises(IllegalSwap, match="may not take"):
        c.vacate(0, tick=0)
    b.vacate(0, tick=0)
    tell(b, c)
    c.vacate(0, tick=0)
    assert (b.slot, c.slot) == (0, 1)


# Restart


def test_an_amnesiac_joins_when_two_have_told_it_the_same() -> None:
    swarm = parties(3)
    swarm[0].vacate(2, tick=0)
    rounds(swarm, 8)
    swarm[1].vacate(2, tick=0)  # settled and open swaps both
    tell(swarm[1], swarm[2])
    again = SlotParty(0, range(3), RULES, nonce=1, amnesiac=True)
    assert not again.quiet
    tell(again, *swarm[1:])
    tell(swarm[1], again)
    assert again.slot_of == swarm[1].slot_of
    tell(swarm[1], again)
    assert again.stance is Stance.AMNESIAC, "one may be lying"
    tell(swarm[2], again)
    assert again.stance is Stance.IDLE


def test_of_two_the_other_is_believed() -> None:
    a, _ = parties(2)
    a.vacate(1, tick=0)
    again = SlotParty(1, range(2), RULES, nonce=1, amnesiac=True)
    rounds([a, again], 2)
    assert again.stance is Stance.IDLE
    assert again.slot_of == a.slot_of


def test_an_amnesiac_agrees_to_nothing() -> None:
    a, *_ = parties(3)
    b = SlotParty(1, range(3), RULES, nonce=1, amnesiac=True)
    a.propose(1, tick=0)
    tell(a, b)
    tell(b, a)
    assert (a.counts.refused, b.counts.accepted) == (1, 0)


def test_amnesiacs_cannot_teach_each_other() -> None:
    pair = [SlotParty(agent, range(2), RULES, nonce=1, amnesiac=True) for agent in range(2)]
    rounds(pair, 5)
    assert {party.stance for party in pair} == {Stance.AMNESIAC}


def test_an_amnesiac_is_not_made_sure_by_another() -> None:
    a, *_ = parties(3)
    pair = [SlotParty(agent, range(3), RULES, nonce=1, amnesiac=True) for agent in (1, 2)]
    tell(a, *pair)
    rounds(pair, 3)
    assert {party.stance for party in pair} == {Stance.AMNESIAC}


def test_an_amnesiac_does_not_mistake_who_had_older_swaps_for_who_had_them_all() -> None:
    a, b, c = parties(3)
    a.vacate(2, tick=0)
    tell(a, b, c)
    a.vacate(2, tick=0)
    tell(a, b)  # c never hears of this one
    again = SlotParty(0, range(3), RULES, nonce=1, amnesiac=True)
    tell(c, again)
    tell(b, again)
    assert again.book.count == 2
    assert again.book.settled == 0, "nothing may be settled that c has not had"


def test_a_restarted_agent_never_reuses_a_name() -> None:
    a, b = parties(2)
    a.vacate(1, tick=0)  # and dies before anybody hears of it
    again = SlotParty(0, range(2), RULES, nonce=1, amnesiac=True)
    rounds([again, b], 3)
    again.vacate(1, tick=0)
    first, second = a.book.open[0], again.book.open[0]
    assert first.counter == second.counter
    assert first[:3] != second[:3]


def test_a_copy_goes_its_own_way() -> None:
    a, _ = parties(2)
    twin = copy(a)
    twin.vacate(1, tick=0)
    assert (a.slot, a.counts.vacated, a.book.count) == (0, 0, 0)
    assert twin.slot == 1


def test_rules_that_cannot_work_are_rejected() -> None:
    for wrong in ({"repair_per_frame": 0}, {"repair_per_frame": 17}, {"repair_frames": 0}):
        with pytest.raises(ValueError, match=r"note holds|at least"):
            SwapRules(**wrong)
