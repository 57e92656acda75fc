"""When a swap is worth asking for, and when the slot of a silent drone is there to be taken."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from protocols.mission.formation import build_formation, shape_points
from protocols.relative import UNKNOWN, RadioRules
from protocols.slots.trigger import (
    CONTACT,
    NOBODY,
    TREE,
    Known,
    Shape,
    SwapRules,
    affected_connected,
    contact_gain,
    swap_partner,
    tree_gain,
    vacancy_to_fill,
)
from tests.hops import within

METRES = st.floats(-20, 20)
VECTOR = st.tuples(METRES, METRES)
LINE = build_formation(
    shape_points("line", 5, 5.0), 5.0
)  # slots 0 1 2 3 4 abreast; root 2, then 1 and 3, then 0 and 4
DEPTH = np.array([2, 1, 0, 1, 2])
ME, OTHER = 1, 3
RADIO = RadioRules(range_m=6.0, memory_ticks=50, max_hops=3, speed_mps=10.0)


def square(vector: NDArray[np.float64]) -> float:
    return float(vector @ vector)


@given(error=VECTOR, rel=VECTOR, slots=VECTOR)
def test_a_contact_swap_lowers_the_squared_distances_by_exactly_what_it_says(
    error: tuple[float, float], rel: tuple[float, float], slots: tuple[float, float]
) -> None:
    mine, theirs = np.array(error), np.array(error) + np.array(slots)  # the two targets, from me
    other = np.array(rel)
    before = square(mine) + square(theirs - other)
    after = square(theirs) + square(mine - other)
    gain = contact_gain(*rel, *slots, 0.0)
    assert gain == pytest.approx(max(0.0, before - after), abs=1e-6)


def test_a_contact_swap_needs_the_margin_along_the_line_of_the_slots() -> None:
    # The other's slot is 5 m ahead of mine; it is behind me by less, by exactly, by more than half a metre.
    assert contact_gain(-0.4, 0.0, 5.0, 0.0, 0.5) == 0.0
    assert contact_gain(-0.5, 0.0, 5.0, 0.0, 0.5) == 0.0
    assert contact_gain(-0.6, 0.0, 5.0, 0.0, 0.5) == pytest.approx(6.0)
    assert contact_gain(0.0, 9.0, 5.0, 0.0, 0.5) == 0.0, "beside me is not behind me"


@given(error=VECTOR, rel=VECTOR, slots=VECTOR, margin=st.floats(0, 2))
def test_a_tree_swap_brings_both_closer_by_the_margin(
    error: tuple[float, float], rel: tuple[float, float], slots: tuple[float, float], margin: float
) -> None:
    mine, theirs, other = np.array(error), np.array(error) + np.array(slots), np.array(rel)
    leader_gains = np.linalg.norm(mine) - np.linalg.norm(mine - other)
    follower_gains = np.linalg.norm(theirs - other) - np.linalg.norm(theirs)
    gain = tree_gain(*error, *rel, *slots, margin)
    if min(leader_gains, follower_gains) > margin + 1e-9:
        assert gain == pytest.approx(leader_gains + follower_gains)
    elif min(leader_gains, follower_gains) < margin - 1e-9:
        assert gain == 0.0


def ask(me: int, rule: int, places: list[float], fresh: bool = True, connected: bool = False) -> int:
    """Whom drone ``me`` asks. Drone i holds slot i of a line abreast, is at places[i], and reaches 6 m."""
    y = np.array(places)
    rel = np.stack([np.zeros(5), y - y[me]], axis=1)
    hops = np.ceil(np.abs(rel[:, 1]) / 6.0).astype(np.int64)
    heard = np.full(5, 99 if fresh else 10)
    slots = np.arange(5)
    error = LINE.offsets[me, 1] - y[me]
    rules = SwapRules(rule=rule, margin_m=0.5, connected=connected, silent_ticks=400)
    shape, known = (
        Shape(LINE.offsets, LINE.parent, DEPTH),
        Known(slots, slots, heard, heard, hops, rel, within(hops)),
    )
    asked = swap_partner(me, 100, rules, RADIO, (0.0, error), shape, known)
    return int(asked)


IN_PLACE = [-10.0, -5.0, 0.0, 5.0, 10.0]
CROSSED = [-10.0, 0.0, -5.0, 5.0, 10.0]  # drones 1 and 2 have changed places


@pytest.mark.parametrize("rule", [TREE, CONTACT])
def test_who_is_in_place_asks_nobody(rule: int) -> None:
    assert [ask(me, rule, IN_PLACE) for me in range(5)] == [NOBODY] * 5


@pytest.mark.parametrize("rule", [TREE, CONTACT])
def test_of_two_that_stand_crossed_the_one_nearer_the_root_asks(rule: int) -> None:
    assert ask(2, rule, CROSSED) == 1
    assert ask(1, rule, CROSSED) == NOBODY


def test_the_tree_rule_knows_only_leader_and_follower() -> None:
    # Drones 0 and 4 have no edge in common; both are on the other's side.
    far = [3.0, -5.0, 0.0, 5.0, -2.0]
    assert ask(0, TREE, far) == NOBODY
    assert ask(0, CONTACT, far) == 4


def test_the_one_that_gains_most_is_asked() -> None:
    # The root, slot 2, is far to the right: drone 3 is wrong by 2 m, drone 4 by 4 m.
    assert ask(2, CONTACT, [-10.0, -5.0, 9.0, 7.0, 5.0]) == 4


def test_one_that_has_not_been_heard_lately_is_not_asked() -> None:
    assert ask(2, CONTACT, CROSSED, fresh=False) == NOBODY


def test_with_connected_all_drones_concerned_must_hang_together() -> None:
    assert ask(2, CONTACT, CROSSED, connected=True) == 1
    astray = [-12.0, 0.0, -5.0, 5.0, 10.0]  # slot 0's drone is 7 m from the next
    assert ask(2, CONTACT, astray, connected=True) == NOBODY
    assert ask(2, CONTACT, astray, connected=False) == 1


def test_connected_asks_for_one_piece_of_radio_graph() -> None:
    slots = np.arange(5)
    hops = np.ones(5, np.int64)
    rel = np.stack([np.zeros(5), np.array(IN_PLACE)], axis=1)
    assert affected_connected(1, 2, LINE.parent, slots, hops, rel, 6.0)
    assert not affected_connected(1, 2, LINE.parent, slots, hops, rel, 4.9)
    hops[0] = UNKNOWN  # a child of slot 1
    assert not affected_connected(1, 2, LINE.parent, slots, hops, rel, 6.0)
    hops[0], hops[4] = 1, UNKNOWN  # slot 4 has nothing to do with it
    assert affected_connected(1, 2, LINE.parent, slots, hops, rel, 6.0)


def test_the_leaders_of_both_slots_are_affected() -> None:
    slots, rel, hops = np.arange(5), LINE.offsets - LINE.offsets[1], np.array([1, 0, 1, 2, 3])
    apart = rel.copy()
    apart[3, 0] = 20.0
    for far in ((hops, apart), (np.array([1, 0, 1, UNKNOWN, 3]), rel)):
        # Slots 2 and 4: the leader of 4 is 3.
        assert not affected_connected(2, 4, LINE.parent, slots, *far, 6.0)
        assert not affected_connected(4, 2, LINE.parent, slots, *far, 6.0)
    assert affected_connected(0, 4, LINE.parent, slots, hops, 0.2 * rel, 6.0)
    assert not affected_connected(0, 4, LINE.parent, slots, np.array([1, 0, 1, UNKNOWN, 3]), 0.2 * rel, 6.0)
    assert not affected_connected(4, 0, LINE.parent, slots, np.array([1, UNKNOWN, 1, 2, 3]), 0.2 * rel, 6.0)
    assert not affected_connected(0, 4, LINE.parent, slots, np.array([1, UNKNOWN, 1, 2, 3]), 0.2 * rel, 6.0)


def vacancy(
    me: int, silent_since: dict[int, int], places: list[float] | None = None, unseen: tuple[int, ...] = ()
) -> int:
    """Whose slot drone ``me`` of a star of five takes at tick 1000, after 400 ticks of patience."""
    star = build_formation(np.array([(0.0, 0.0), (5.0, 0.0), (-5.0, 0.0), (0.0, 5.0), (0.0, -5.0)]), 5.0)
    points = star.offsets.copy()
    for drone, x in enumerate(places or []):
        points[drone, 0] = x
    last_seen = np.array([silent_since.get(drone, 1000) for drone in range(5)])
    slots = np.arange(5)
    rel = points - points[me]
    hops = np.where(slots == me, 0, 1)
    hops[list(unseen)] = UNKNOWN
    error = tuple(star.offsets[me] - points[me])
    shape, known = (
        Shape(star.offsets, star.parent, slots),
        Known(slots, slots, last_seen, last_seen, hops, rel, within(hops)),
    )
    rules = SwapRules(rule=CONTACT, margin_m=0.5, connected=False, silent_ticks=400)
    return int(vacancy_to_fill(me, 1000, rules, RADIO, error, shape, known))


def test_nobody_takes_the_slot_of_one_that_was_heard_within_the_time() -> None:
    assert [vacancy(me, {0: 600}) for me in range(5)] == [NOBODY] * 5


def test_the_slot_of_a_silent_leader_is_taken_by_exactly_one_follower() -> None:
    # All four are as close: the smallest number takes it.
    assert [vacancy(me, {0: 599}) for me in range(1, 5)] == [0, NOBODY, NOBODY, NOBODY]


def test_the_closest_living_follower_takes_it() -> None:
    places = [0.0, 5.0, -3.0, 0.0, 0.0]
    assert [vacancy(me, {0: 0}, places) for me in range(1, 5)] == [NOBODY, 0, NOBODY, NOBODY]
    assert vacancy(1, {0: 0, 2: 0}, places) == 0, "a dead sibling stands in nobody's way"


def test_a_sibling_of_whom_one_knows_no_place_stands_in_nobodys_way() -> None:
    places = [0.0, 5.0, -3.0, 0.0, 0.0]
    assert vacancy(1, {0: 0}, places) == NOBODY
    assert vacancy(1, {0: 0}, places, unseen=(2,)) == 0


def test_the_slot_of_a_silent_follower_stays_empty() -> None:
    assert [vacancy(me, {4: 0}) for me in range(4)] == [NOBODY] * 4


def test_who_is_out_of_range_of_the_slot_does_not_judge_that_it_is_empty() -> None:
    assert vacancy(1, {0: 0}, [0.0, 5.9, -9.0, 0.0, 0.0]) == NOBODY, "drones 3 and 4 are nearer"
    others_dead = {0: 0, 2: 0, 3: 0, 4: 0}
    assert vacancy(1, others_dead, [0.0, 5.9]) == 0
    assert vacancy(1, others_dead, [0.0, 6.1]) == NOBODY
