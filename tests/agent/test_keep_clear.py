"""A drone that sees nobody keeps clear of others by what it hears, also of those whom it has missed."""

import math

import numpy as np
import pytest

from agent.heard import find_heard, keep_clear, listens, stand_still, take_word
from agent.memory import Memory, empty_memory, forget
from agent.perceive import hear_frame
from agent.rules import rules_of
from agent.tick_arrays import Rules
from protocols.mission.document import parse_mission
from protocols.wire.frames import empty_frames
from protocols.wire.sensed import empty_sensed

N, NOW = 8, 500
SLOW = rules_of(
    parse_mission({"agents": N, "radio": {"frame_rate_hz": 10}, "sensing": {"neighbours": "heard"}})
)


def say(
    memory: Memory,
    sender: int,
    tick: int,
    motion: tuple[float, ...],
    near: dict[int, tuple[float, float]] | None = None,
) -> None:
    """Drone 0 hears ``sender``: p, v, and where its neighbours are from it."""
    frames, near = empty_frames(1), near or {}
    frames.fixed[0]["sender"], frames.fixed[0]["tick"], frames.fixed[0]["motion"] = sender, tick, motion
    frames.fixed[0]["one_hop"] = frames.fixed[0]["known_count"] = len(near)
    for place, (other, displacement) in enumerate(near.items()):
        frames.known[0, place], frames.displacement[0, place] = other, displacement
    hear_frame(memory, 0, frames, 0, SLOW.radio)
    take_word(memory, 0, 0, sender, tick, SLOW)


def believed(
    memory: Memory, tick: int = NOW, rules: Rules = SLOW
) -> dict[int, tuple[list[float], list[float]]]:
    """Whom drone 0, which stands at the origin, keeps clear of: where, and how it moves."""
    sensed = empty_sensed(1)
    find_heard(memory, 0, 0, tick, sensed, rules.radio, rules.limits.max_acceleration)
    keep_clear(memory, 0, 0, tick, sensed, rules)
    count = memory.near_count[0]
    numbers = memory.near_id[0, :count].tolist()
    assert len(set(numbers)) == count
    return {
        number: (memory.near_rel[0, place].tolist(), memory.near_vel[0, place].tolist())
        for place, number in enumerate(numbers)
    }


def test_one_heard_just_now_is_where_it_says() -> None:
    memory = empty_memory(1, N)
    say(memory, 3, NOW, (3.0, 4.0, 1.0, 0.0))
    assert believed(memory) == {3: ([3.0, 4.0], [1.0, 0.0])}


def test_the_older_what_is_known_the_nearer_it_is_taken_to_be_but_only_so_much() -> None:
    memory = empty_memory(1, N)
    say(memory, 3, NOW, (4.0, 0.0, 0.0, 0.0))
    nearest = [believed(memory, NOW + age)[3][0][0] for age in range(0, 200, 10)]
    assert nearest == sorted(nearest, reverse=True)
    assert nearest[0] == 4.0
    assert nearest[-1] == pytest.approx(4.0 - 0.8)


def test_doubt_never_turns_a_direction_around() -> None:
    memory = empty_memory(1, N)
    say(memory, 3, NOW, (0.55, 0.0, 0.0, 0.0))
    assert 0.0 < believed(memory, NOW + 150)[3][0][0] < 0.55


def test_one_that_was_missed_is_where_a_neighbour_says() -> None:
    memory = empty_memory(1, N)
    say(memory, 3, NOW - 45, (5.0, 0.0, 0.0, 0.0))
    say(memory, 4, NOW, (0.0, 2.0, 0.0, 0.0), near={3: (3.0, -2.0)})
    assert believed(memory)[3][0] == pytest.approx([3.0, 0.0])


def test_how_one_moves_that_only_others_hear_follows_from_where_they_say_it_was() -> None:
    memory = empty_memory(1, N)
    say(memory, 3, NOW - 60, (5.0, 0.0, 0.0, 0.0))  # and then it set off at once, with 3 m/s to the left
    for age in (40, 20, 0):
        say(memory, 4, NOW - age, (0.0, 2.0, 0.0, 0.0), near={3: (5.0, 0.03 * (60 - age) - 2.0)})
    where, how = believed(memory)[3]
    assert where == pytest.approx([5.0, 1.8])
    assert how == pytest.approx([0.0, 3.0], abs=0.5)


def test_one_that_was_expected_where_others_say_it_is_moves_as_it_did() -> None:
    memory = empty_memory(1, N)
    say(memory, 3, NOW - 50, (2.0, 0.0, 4.0, 0.0))
    say(memory, 4, NOW, (0.0, 2.0, -3.0, 0.0), near={3: (4.0, -2.0)})
    assert believed(memory)[3][1] == pytest.approx([4.0, 0.0])


def test_one_never_heard_is_taken_to_move_like_the_neighbour_that_tells_of_it() -> None:
    memory = empty_memory(1, N)
    say(memory, 4, NOW, (0.0, 2.0, 3.0, 0.5), near={3: (4.0, -2.0)})
    assert believed(memory)[3][1] == pytest.approx([3.0, 0.5])


def test_nothing_that_others_say_makes_a_drone_turn_or_fly_faster_than_one_can() -> None:
    memory = empty_memory(1, N)
    say(memory, 3, NOW, (1.0, 0.0, 0.0, 0.0))
    before = [0.0, 0.0]
    for age in range(20, 200, 20):
        say(memory, 4, NOW + age, (0.0, 0.0, 0.0, 0.0), near={3: (1.0 + 0.2 * age, 0.0)})  # 20 m/s
        now = believed(memory, NOW + age).get(3, ([], before))[1]  # beyond 6 m it is nobody's neighbour
        assert math.dist(before, now) <= 10.0 * 0.2 + 1e-6
        before = now
    assert math.hypot(*memory.news_motion[0, 3, 2:]) == pytest.approx(SLOW.radio.speed_mps)


def test_one_that_was_missed_is_a_neighbour_where_others_say_while_its_own_frame_is_believed() -> None:
    memory = empty_memory(1, N)
    say(memory, 3, NOW - 45, (5.0, 0.0, 0.0, 0.0))
    say(memory, 4, NOW, (0.0, 2.0, 0.0, 0.0), near={3: (4.0, -2.0), 5: (1.0, 1.0)})
    find_heard(memory, 0, 0, NOW, empty_sensed(1), SLOW.radio, 10.0)
    assert memory.near_id[0, : memory.near_count[0]].tolist() == [3, 4]  # and 5 is none: it may be long gone
    assert memory.near_rel[0, 0].tolist() == pytest.approx([4.0, 0.0])


def test_its_own_word_replaces_what_others_said() -> None:
    memory = empty_memory(1, N)
    say(memory, 4, NOW - 20, (0.0, 2.0, 3.0, 0.0), near={3: (4.0, -2.0)})
    say(memory, 3, NOW, (4.2, 0.5, 0.0, 1.0))
    where, how = believed(memory)[3]
    assert (where, how) == ([pytest.approx(4.2), 0.5], [0.0, 1.0])


def test_a_frame_that_is_not_believed_tells_of_nobody() -> None:
    memory = empty_memory(1, N)
    say(memory, 4, NOW, (0.0, 2.0, 999.0, 0.0), near={3: (4.0, -2.0)})
    assert believed(memory) == {}


def test_of_two_who_tell_of_it_the_later_one_counts() -> None:
    memory = empty_memory(1, N)
    say(memory, 4, NOW, (0.0, 2.0, 0.0, 0.0), near={3: (3.0, -2.0)})
    say(memory, 5, NOW - 20, (0.0, -2.0, 0.0, 0.0), near={3: (2.0, 2.0)})
    assert believed(memory)[3][0] == pytest.approx([3.0, 0.0])


def test_its_own_word_goes_before_that_of_others_while_no_frame_of_it_is_due() -> None:
    memory = empty_memory(1, N)
    say(memory, 3, NOW - 10, (5.0, 0.0, 0.0, 0.0))
    say(memory, 4, NOW, (0.0, 2.0, 0.0, 0.0), near={3: (0.6, -2.0)})
    assert believed(memory)[3][0][0] > 4.9


def test_nobody_is_told_where_it_is_itself() -> None:
    memory = empty_memory(1, N)
    say(memory, 4, NOW, (0.0, 2.0, 0.0, 0.0), near={0: (0.0, -2.0)})
    assert list(believed(memory)) == [4]


def test_one_of_whom_nobody_has_heard_is_remembered_for_longer_than_its_frames_are_believed() -> None:
    memory = empty_memory(1, N)
    say(memory, 3, NOW, (4.0, 0.0, 0.0, 0.0))
    for age, known in ((SLOW.radio.memory_ticks + 1, True), (4 * SLOW.radio.memory_ticks + 1, False)):
        assert (3 in believed(memory, NOW + age)) == known
        find_heard(memory, 0, 0, NOW + age, empty_sensed(1), SLOW.radio, 10.0)
        assert memory.near_count[0] == 0  # of what others and the swaps go by, it is none


def test_one_that_turns_is_expected_to_go_on_turning_for_a_moment() -> None:
    memory = empty_memory(1, N)
    say(memory, 3, NOW - 10, (4.0, 0.0, 0.0, 0.0))
    say(memory, 3, NOW, (4.0, 0.0, 0.0, 0.5))
    where, how = believed(memory, NOW + 10)[3]
    assert how == pytest.approx([0.0, 1.0])
    assert where[1] / where[0] == pytest.approx(0.5 * (0.5 + 1.0) * 0.1 / 4.0)
    assert believed(memory, NOW + 80)[3][1] == pytest.approx([0.0, 1.5])  # and no longer


def test_no_drone_is_expected_to_accelerate_more_than_one_can() -> None:
    memory = empty_memory(1, N)
    say(memory, 3, NOW - 1, (4.0, 0.0, 0.0, -5.0))
    say(memory, 3, NOW, (4.0, 0.0, 0.0, 5.0))
    assert believed(memory, NOW + 10)[3][1] == pytest.approx([0.0, 5.0 + 10.0 * 0.1])


def test_a_room_full_of_drones_is_no_crash() -> None:
    rules = rules_of(parse_mission({"agents": 100, "sensing": {"neighbours": "heard"}}))
    memory = empty_memory(1, 100)
    for sender in range(1, 51):
        told = {other: (0.01 * other, 0.5) for other in range(51, 100)}
        say(memory, sender, NOW, (math.cos(sender), math.sin(sender), 0.0, 0.0), near=told)
    assert len(believed(memory, rules=rules)) == memory.near_id.shape[1]


def test_who_begins_stands_still_until_it_has_listened() -> None:
    memory = empty_memory(1, N)
    forget(memory, 0, NOW)
    waits = 2 * SLOW.radio.memory_ticks
    assert [listens(NOW + age, 0, SLOW, memory) for age in (0, waits - 1, waits)] == [True, True, False]
    assert not listens(
        NOW, 0, rules_of(parse_mission({"agents": N})), memory
    )  # with sensors there is no need
    assert np.dot(stand_still((2.0, -1.0)), (2.0, -1.0)) < 0.0
