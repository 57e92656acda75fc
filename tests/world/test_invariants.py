"""The invariants: what it takes for a breach, and what it measures."""

import numpy as np
import pytest

from protocols.wire.status import SWAP_COUNTS, AgentStatus
from world.invariants import Invariants

FIRST, SWAPPED = bytes([0, 1, 2]), bytes([1, 0, 2])
ALL = [0, 1, 2]


def account(agent: int, view: bytes, digest: int, **counts: int) -> AgentStatus:
    swaps = tuple(counts.get(name, 0) for name in SWAP_COUNTS)
    return AgentStatus(view[agent], 2, (0,) * 7, swaps, digest, view)


def watch_of(*views: tuple[bytes, int]) -> Invariants:
    watch = Invariants(np.arange(3, dtype=np.int16), cooldown_s=1.0)
    for agent, (view, digest) in enumerate(views):
        watch.see(0, agent, account(agent, view, digest))
    return watch


def test_equal_views_break_nothing() -> None:
    watch = watch_of((FIRST, 7), (FIRST, 7), (FIRST, 7))
    for tick in range(100):
        watch.tick(tick, ALL)
    watched = watch.result()
    assert (watched.breach, watched.views_differ_s, watched.agreed_after_s) == (None, 0.0, 0.0)


def test_a_view_in_which_a_slot_is_held_twice_discredits_its_drone() -> None:
    watch = watch_of((FIRST, 7))
    ((agent, why),) = watch.see(31, 2, account(2, bytes([0, 1, 1]), 8))
    assert (agent, why) == (2, "its account of itself cannot be true: it believes [0, 1, 1]")
    assert watch.breach == "permutation broken at tick 31: agent 2 believes [0, 1, 1]"


def test_who_contradicts_the_majority_that_knows_the_same_is_discredited_and_nobody_else() -> None:
    watch = watch_of((FIRST, 7), (FIRST, 7))
    assert [agent for agent, _ in watch.see(31, 2, account(2, SWAPPED, 7))] == [2]
    assert watch.breach == (
        "agreement broken at tick 31: agent 2 knows what agent 0 knows but believes [1, 0, 2]"
    )


def test_of_two_who_contradict_each_other_nobody_is_discredited_until_a_third_speaks() -> None:
    """Also not the first to speak: whoever lies may be that one."""
    watch = Invariants(np.arange(3, dtype=np.int16), cooldown_s=1.0)
    assert watch.see(0, 2, account(2, SWAPPED, 7)) == []
    assert watch.see(1, 0, account(0, FIRST, 7)) == []
    assert watch.result().breach == (
        "agreement broken: agents 2 and 0 know the same swaps but believe [1, 0, 2] and [0, 1, 2]"
    )
    assert [agent for agent, _ in watch.see(2, 1, account(1, FIRST, 7))] == [2]


def test_what_the_discredited_told_is_held_against_nobody() -> None:
    watch = Invariants(np.arange(3, dtype=np.int16), cooldown_s=1.0)
    watch.see(0, 2, account(2, SWAPPED, 7))
    watch.see(1, 2, account(2, bytes([0, 0, 0]), 8))
    watch.see(2, 0, account(0, FIRST, 7))
    assert "permutation" in str(watch.result().breach)


def test_a_drone_that_claims_another_slot_than_it_told_of_is_discredited() -> None:
    watch, flying = watch_of((FIRST, 7), (SWAPPED, 8)), np.ones(3, np.bool_)
    assert watch.claims(3, np.array([0, 0, 2]), flying) == []
    assert [agent for agent, _ in watch.claims(4, np.array([0, 0, 1]), flying)] == [2]
    assert watch.claims(5, np.array([0, 0, 1]), flying & [True, True, False]) == []


def test_who_begins_anew_may_count_anew_and_claim_its_first_slot() -> None:
    watch = watch_of((FIRST, 7), (FIRST, 7))
    watch.see(50, 1, account(1, SWAPPED, 9, committed=3))
    watch.renew(1)
    assert watch.claims(51, np.array([0, 1, 2]), np.ones(3, np.bool_)) == []
    assert watch.see(52, 1, account(1, FIRST, 7)) == []


def test_counts_never_fall() -> None:
    watch = watch_of((FIRST, 7))
    watch.see(10, 0, account(0, FIRST, 7, refused=3))
    assert [agent for agent, _ in watch.see(20, 0, account(0, FIRST, 7, refused=2))] == [0]


def test_accounts_without_end_do_not_fill_the_memory() -> None:
    watch = watch_of((FIRST, 7))
    for number in range(2000):
        watch.see(number, 0, account(0, FIRST, 1000 + number))
    assert len(watch._views_of) <= 257


def test_equal_views_of_unequal_knowledge_are_none() -> None:
    assert watch_of((FIRST, 7), (FIRST, 8), (SWAPPED, 9)).result().breach is None


def test_the_first_breach_is_kept() -> None:
    watch = watch_of((bytes([0, 0, 2]), 7), (bytes([2, 2, 2]), 8))
    assert watch.breach is not None
    assert "agent 0" in watch.breach


def test_more_swaps_in_a_second_than_a_drone_can_make_discredit_it() -> None:
    watch = watch_of((FIRST, 7), (FIRST, 7), (FIRST, 7))
    for number in range(1, 5):
        assert watch.see(10 * number, 0, account(0, FIRST, 7, committed=number)) == []
    assert watch.see(50, 0, account(0, FIRST, 7, committed=5))[0] == (
        0, "its account of itself cannot be true: it makes 5 swaps within a second",
    )  # fmt: skip


def test_more_swaps_in_a_second_than_three_drones_can_make_are_a_livelock() -> None:
    watch = watch_of((FIRST, 7), (FIRST, 7), (FIRST, 7))
    for number in range(1, 8):
        agent, made = number % 2, (number + 1) // 2
        assert watch.see(10 * number, agent, account(agent, FIRST, 7, committed=made)) == []
        assert watch.breach is None
        watch.tick(10 * number, ALL)
    assert watch.breach == "livelock at tick 70: 7 swaps within one second, at most 6 are possible"


def test_as_many_swaps_spread_over_more_than_a_second_are_none() -> None:
    watch = watch_of((FIRST, 7), (FIRST, 7), (FIRST, 7))
    for tick in range(1, 400):
        if tick % 20 == 0:
            agent, made = tick // 20 % 3, (tick // 20 + 2) // 3
            watch.see(tick, agent, account(agent, FIRST, 7, committed=made))
        watch.tick(tick, ALL)
    assert watch.breach is None
    assert watch.result().most_swaps_in_a_second == 5


def test_the_time_of_unlike_views_is_counted_until_all_have_learnt() -> None:
    watch = watch_of((FIRST, 7), (FIRST, 7), (FIRST, 7))
    for tick in range(100):
        for agent, when in ((0, 20), (1, 24), (2, 32)):
            if tick == when:
                watch.see(tick, agent, account(agent, SWAPPED, 8))
        watch.tick(tick, ALL)
    watched = watch.result()
    assert watched.views_differ_s == pytest.approx(0.12)
    assert watched.agreed


def test_agreement_is_timed_from_the_last_fault() -> None:
    watch = watch_of((FIRST, 7), (FIRST, 7), (FIRST, 7))
    for tick in range(100):
        if tick == 25:
            watch.fault(tick)
        if tick == 20:
            watch.see(tick, 0, account(0, SWAPPED, 8))
        if tick == 30:
            watch.see(tick, 1, account(1, SWAPPED, 8))
            watch.see(tick, 2, account(2, SWAPPED, 8))
        watch.tick(tick, ALL)
    assert watch.result().agreed_after_s == pytest.approx(0.05)


def test_who_is_dead_need_not_agree() -> None:
    watch = watch_of((FIRST, 7), (SWAPPED, 8), (FIRST, 7))
    watch.tick(0, ALL)
    for tick in range(1, 10):
        watch.tick(tick, [0, 2])
    assert watch.result().views_differ_s == pytest.approx(0.01)
    assert watch.result().agreed_after_s == pytest.approx(0.01)


def test_a_flight_that_ends_in_disagreement_says_so() -> None:
    watch = watch_of((FIRST, 7), (SWAPPED, 8), (FIRST, 7))
    for tick in range(10):
        watch.tick(tick, ALL)
    assert watch.result().agreed_after_s is None
    assert not watch.result().agreed


def test_swaps_turned_off_by_a_merge_are_added_up() -> None:
    watch = Invariants(np.arange(3, dtype=np.int16), cooldown_s=1.0)
    watch.see(0, 0, account(0, FIRST, 7, undone=2))
    watch.see(0, 1, account(1, FIRST, 7, undone=1))
    watch.see(5, 1, account(1, FIRST, 7, undone=3))
    assert watch.result().undone == 5


def test_what_the_radio_allowed_is_timed_beside_what_the_drones_made_of_it() -> None:
    """Drone 0 swaps at tick 20, when the radio heals; drone 2 could know at tick 24, and learns of it at tick 32."""
    watch = watch_of((FIRST, 7), (FIRST, 7), (FIRST, 7))
    for tick in range(50):
        could_know = np.full((3, 3), tick)
        could_know[2] = tick if tick >= 24 else 0
        if tick == 20:
            watch.fault(tick)
        for agent, when in ((0, 20), (1, 21), (2, 32)):
            if tick == when:
                watch.see(tick, agent, account(agent, SWAPPED, 8, committed=int(agent == 0)))
        watch.tick(tick, ALL, could_know)
    assert watch.result().allowed_after_s == pytest.approx(0.04)
    assert watch.result().agreed_after_s == pytest.approx(0.12)
