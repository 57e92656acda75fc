"""The swap protocol, one story per rule: dead drones' slots, what all get to know, and drones that begin anew."""

from __future__ import annotations

from copy import copy

import msgpack
import pytest

from protocols.slots.agreement import IllegalSwap, SlotParty, Stance, SwapRules, encode
from protocols.slots.history import MAX_TAKEN
from tests.protocols.swap_parties import RULES, parties, rounds, tell

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
    assert a.note(5) == a.note(6) == note


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


def test_an_amnesiac_takes_its_dead_leaders_slot() -> None:
    """It may hear one neighbour for the rest of the flight, and nobody else may be there to take it."""
    a, b, *_ = parties(4)
    b.vacate(3, tick=0)
    tell(b, a)
    again = SlotParty(0, range(4), RULES, nonce=1, amnesiac=True)
    tell(b, again)
    again.vacate(3, tick=0)
    assert (again.slot, again.stance) == (1, Stance.AMNESIAC)
    tell(again, b)
    assert b.slot_of == again.slot_of


def test_what_an_amnesiac_takes_undoes_nothing_it_has_forgotten() -> None:
    a, b, c, _ = parties(4)
    a.propose(1, tick=0)
    rounds([a, b], 3)  # c, out of reach, does not hear of it
    again = SlotParty(0, range(4), RULES, nonce=1, amnesiac=True)
    tell(c, again)
    again.vacate(3, tick=0)
    tell(again, b)
    assert b.slot_of == (1, 0, 2, 3), "what two agreed to stands"
    assert b.counts.undone == 0


def test_where_nobody_remembers_ranks_are_closed_all_the_same() -> None:
    pair = [SlotParty(agent, range(3), RULES, nonce=1, amnesiac=True) for agent in range(2)]
    pair[0].vacate(2, tick=0)
    rounds(pair, 3)
    assert {party.slot_of for party in pair} == {(2, 1, 0)}


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
