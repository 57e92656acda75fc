"""The referee: what is a collision, what is success, when it is too late, and which slots may stay empty."""

from typing import Any

import numpy as np
import pytest

from protocols.mission.document import parse_mission
from world.core import Answers, WorldCore
from world.outcome import Outcome

# Five slots abreast: 0 1 2 3 4 from right to left, 2 the root, 0 and 4 the leaves.
LINE = [[40.0, y] for y in (-10.0, -5.0, 0.0, 5.0, 10.0)]


def world(positions: list[list[float]] = LINE, **fields: Any) -> WorldCore:
    task = {"agents": 5, "formation": {"shape": "line"}, "obstacles": {"discs": []}, **fields}
    core = WorldCore([parse_mission(task)])
    core.position[0] = positions
    return core


def judged(core: WorldCore, claims: list[int] | None = None, ticks: int = 1) -> Outcome | None:
    """What came of the flight after drones that do nothing have claimed these slots for so many ticks."""
    for _ in range(ticks):
        if core.active[0]:
            core.begin_tick()
            core.advance(Answers(np.zeros((5, 2)), np.zeros(5, np.int64), np.array(claims or range(5))))
    return core.outcomes[0]


def moved(agent: int, x: float, y: float) -> list[list[float]]:
    places = [list(place) for place in LINE]
    places[agent] = [x, y]
    return places


def test_a_formation_beyond_the_goal_line_has_succeeded() -> None:
    outcome = judged(world())
    assert outcome is not None
    assert (outcome.success, outcome.failure, outcome.tau_s, outcome.ticks) == (True, None, 0.01, 1)
    assert outcome.max_edge_error == 0.0
    assert outcome.min_distance_m == 5.0


@pytest.mark.parametrize(("x", "over"), [(35.0, False), (np.nextafter(35.0, 36), True)])
def test_every_drone_must_be_past_the_goal_line(x: float, over: bool) -> None:
    assert (judged(world([[x, y] for _, y in LINE])) is not None) is over
    assert judged(world(moved(4, 34.9, 10.0))) is None, "the last one is not over it"


def test_every_obstacle_must_lie_behind_too() -> None:
    # The far edge of this disc is at x = 40.5.
    discs = {"discs": [[39.0, 30.0, 1.5], [20.0, 30.0, 1.0]]}
    assert judged(world(obstacles=discs)) is None
    assert judged(world([[40.6, y] for _, y in LINE], obstacles=discs)) is not None


@pytest.mark.parametrize(("y", "formed"), [(10.49, True), (10.51, False), (9.51, True), (9.49, False)])
def test_every_edge_must_be_within_ten_percent(y: float, formed: bool) -> None:
    core = world(moved(4, 40.0, y))
    assert (judged(core) is not None) is formed
    assert core.edge_error[0, 4] == pytest.approx(abs(y - 10.0) / 5.0)


def test_the_time_of_success_is_the_first_tick_at_which_all_holds() -> None:
    core = world(moved(4, 40.0, 11.0))
    assert judged(core, ticks=7) is None
    core.position[0] = LINE
    outcome = judged(core)
    assert outcome is not None
    assert (outcome.tau_s, outcome.ticks) == (0.08, 8)


def test_the_slot_error_is_reported_and_asked_of_nobody() -> None:
    core = world([[x + 25.0, y] for x, y in LINE])
    outcome = judged(core)
    assert outcome is not None
    assert outcome.success
    assert outcome.max_slot_error_m == pytest.approx(65.0 - 0.03)


@pytest.mark.parametrize(("gap", "collides"), [(0.49, True), (0.51, False)])
def test_two_drones_collide_below_half_a_metre(gap: float, collides: bool) -> None:
    outcome = judged(world(moved(4, 40.0, 5.0 + gap)))
    assert (outcome is not None) is collides
    if outcome:
        assert (outcome.success, outcome.failure) == (False, "collision")
        assert outcome.min_distance_m == pytest.approx(gap)
        assert outcome.closest == "agents 3 and 4 at x = 40.0 m, y = 5.2 m, t = 0.01 s"


@pytest.mark.parametrize(("gap", "collides"), [(0.49, True), (0.51, False)])
def test_a_drone_collides_below_half_a_metre_from_an_obstacles_surface(gap: float, collides: bool) -> None:
    core = world(obstacles={"discs": [[20.0, 30.0, 1.0], [20.0, -20.0, 2.0]]})
    core.position[0] = moved(0, 20.0, -18.0 + gap)
    outcome = judged(core)
    assert (outcome is not None) is collides
    if outcome:
        assert outcome.failure == "collision"
        assert outcome.closest.startswith("agent 0 and obstacle 1 at x = 20.0 m")


def test_a_collision_counts_more_than_a_success_of_the_same_tick() -> None:
    places = [[40.0, 0.0]] * 5
    outcome = judged(world(places))
    assert outcome is not None
    assert outcome.failure == "collision"


def test_a_flight_is_late_after_two_thousand_one_hundred_ticks() -> None:
    core = world([[0.0, y] for _, y in LINE])
    assert judged(core, ticks=2099) is None
    outcome = judged(core)
    assert outcome is not None
    assert (outcome.success, outcome.failure, outcome.tau_s, outcome.ticks) == (False, "late", None, 2100)


def test_success_in_the_last_tick_is_success() -> None:
    core = world([[0.0, y] for _, y in LINE], fly_s=0.1)
    judged(core, ticks=9)
    core.position[0] = LINE
    outcome = judged(core)
    assert outcome is not None
    assert (outcome.success, outcome.tau_s) == (True, 0.1)


def test_drones_may_hold_any_slots_as_long_as_the_edges_fit() -> None:
    assert judged(world(LINE[::-1]), [4, 3, 2, 1, 0]) is not None
    assert judged(world(), [1, 0, 2, 3, 4]) is None, "who claims slot 1 stands in slot 0"


def test_an_empty_leaf_is_allowed() -> None:
    core = world()
    core.flying[0, [4]] = False
    outcome = judged(core)
    assert outcome is not None
    assert outcome.success
    assert outcome.lost_agents == (4,)


def test_an_empty_slot_is_allowed_when_all_below_it_are_empty() -> None:
    """Nobody is left to move up; found by a campaign that killed two drones, one below the other."""
    core = world()
    core.flying[0, [3, 4]] = False
    outcome = judged(core)
    assert outcome is not None
    assert outcome.success


def test_an_empty_inner_slot_is_not() -> None:
    core = world()
    core.flying[0, [3]] = False
    assert judged(core, ticks=3) is None


def test_when_the_next_has_moved_up_and_left_a_leaf_it_is_success() -> None:
    core = world(moved(4, 40.0, 5.0))
    core.flying[0, [3]] = False
    assert judged(core, [0, 1, 2, 3, 3]) is not None


def test_two_claims_on_one_slot_are_no_formation_and_counted() -> None:
    core = world(moved(4, 41.0, -10.0))  # beside the other: all edges are right, whoever of the two counts
    assert judged(core, [0, 1, 2, 3, 0], ticks=5) is None
    core.end(0, "interrupted")
    outcome = core.outcomes[0]
    assert outcome is not None
    assert outcome.overlap_s == pytest.approx(0.05)


def test_the_dead_collide_with_nobody() -> None:
    core = world(moved(4, 40.0, 5.1))
    core.flying[0, [4]] = False
    assert judged(core) is not None
    assert core.nearest[0, 3] == 5.0
    assert core.nearest[0, 4] == np.inf


def test_nobody_left_is_no_success() -> None:
    core = world()
    core.flying[0, list(range(5))] = False
    assert judged(core, ticks=3) is None


def test_a_formation_that_must_hold_is_watched_for_that_long() -> None:
    core = world(hold_s=0.05)
    assert judged(core, ticks=5) is None
    outcome = judged(core)
    assert outcome is not None
    assert (outcome.tau_s, outcome.ticks, outcome.held_after_success) == (0.01, 6, True)
    loose = world(hold_s=0.05)
    judged(loose, ticks=2)
    loose.position[0] = moved(4, 40.0, 11.0)
    judged(loose)
    loose.position[0] = LINE
    outcome = judged(loose, ticks=3)
    assert outcome is not None
    assert (outcome.success, outcome.tau_s, outcome.held_after_success) == (True, 0.01, False)
    assert outcome.max_edge_error == 0.0, "as it was at tau"


def test_without_hold_nothing_is_said_about_holding() -> None:
    outcome = judged(world())
    assert outcome is not None
    assert outcome.held_after_success is None
