"""The safety filter: changes nothing needlessly, finds the optimum, keeps hostile commands from contact."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.control.gains import LIMITS, limits_for
from agent.control.halfplanes import least_violation, nearest_point
from agent.control.safety import barrier_bound, safety_filter
from agent.control.surroundings import Discs, Neighbours
from agent.rules import rules_of
from protocols.mission.document import parse_mission

DT = 0.01
RADIUS = 10.0
NOBODY = Neighbours(0, np.zeros((0, 2)), np.zeros((0, 2)))
NOTHING = Discs(0, np.zeros((0, 2)), np.zeros(0), np.zeros(0, np.int8))


def neighbours(*rows: tuple[float, float, float, float]) -> Neighbours:
    table = np.array(rows, float).reshape(-1, 4)
    return Neighbours(len(table), table[:, :2].copy(), table[:, 2:].copy())


def discs(*rows: tuple[float, float, float]) -> Discs:
    table = np.array(rows, float).reshape(-1, 3)
    return Discs(len(table), table[:, :2].copy(), table[:, 2].copy(), np.zeros(len(table), np.int8))


# --- what it leaves alone ----------------------------------------------------------------------------------


def test_a_safe_command_passes_bit_for_bit():
    wish = (1.234567, -0.987654)
    assert (
        safety_filter(wish, (3.0, 0.0), neighbours((5.0, 0.0, 0.0, 0.0)), discs((9.0, 1.0, 1.5)), LIMITS)
        == wish
    )


def test_a_command_beyond_the_limit_is_shortened_not_turned():
    assert safety_filter((30.0, 40.0), (0.0, 0.0), NOBODY, NOTHING, LIMITS) == pytest.approx((6.0, 8.0))


def test_flying_away_is_never_hindered():
    near = neighbours((-0.8, 0.0, -1.0, 0.0))
    assert safety_filter((9.0, 0.0), (2.0, 0.0), near, discs((-1.8, 0.0, 1.0)), LIMITS) == (9.0, 0.0)


def test_limits_are_those_of_the_mission():
    assert limits_for(10.0, 0.5) == LIMITS
    assert limits_for(5.0, 0.5).obstacle_brake == LIMITS.obstacle_brake / 2
    mission = parse_mission({"limits": {"collision_m": 0.9, "acceleration_mps2": 8}})
    assert rules_of(mission).limits == limits_for(8.0, 0.9)
    assert rules_of(mission).limits.agent_clearance == pytest.approx(0.4 + LIMITS.agent_clearance)
    assert rules_of(mission).gains.contact_m == 0.9


# --- what it asks for --------------------------------------------------------------------------------------


def test_full_speed_towards_a_near_wall_becomes_braking():
    a_x, a_y = safety_filter((10.0, 0.0), (5.0, 0.0), NOBODY, discs((4.0, 0.0, 1.5)), LIMITS)
    assert a_x < -6.0
    assert a_y == pytest.approx(0.0)


def test_only_the_part_towards_the_obstacle_is_taken_away():
    a_x, a_y = safety_filter((5.0, 4.0), (0.0, 0.0), NOBODY, discs((2.1, 0.0, 1.5)), LIMITS)
    assert a_x == pytest.approx(0.0, abs=0.1)
    assert a_y == pytest.approx(4.0)


@pytest.mark.parametrize("what", ["obstacle", "neighbour"])
def test_swinging_around_something_is_room_gained(what: str) -> None:
    """v_tan²/r: who passes sideways gets away from it without any push, and may push towards it by as much."""

    def most(v_tan: float) -> float:
        if what == "obstacle":
            return safety_filter((9.9, 0.0), (0.0, v_tan), NOBODY, discs((3.0, 0.0, 2.25)), LIMITS)[0]
        limits = LIMITS._replace(agent_clearance=2.9)
        return safety_filter((9.9, 0.0), (0.0, 0.0), neighbours((3.0, 0.0, 0.0, v_tan)), NOTHING, limits)[0]

    share = 1.0 if what == "obstacle" else LIMITS.agent_share
    assert most(4.0) - most(0.0) == pytest.approx(share * 4.0**2 / 3.0)


def test_a_pair_shares_the_burden_between_them():
    full = barrier_bound(1.5, -3.0, 0.0, 12.0, 0.65, 1.0, LIMITS._replace(row_limit=math.inf))
    half = barrier_bound(1.5, -3.0, 0.0, 12.0, 0.65, 0.5, LIMITS._replace(row_limit=math.inf))
    assert 0.0 < half == pytest.approx(full / 2)


def test_no_row_asks_for_more_than_the_row_limit():
    assert barrier_bound(0.6, -9.0, 0.0, 6.0, 0.6, 1.0, LIMITS) == LIMITS.row_limit


# --- the program behind it ---------------------------------------------------------------------------------


def best_by_enumeration(rows: np.ndarray, goal: np.ndarray) -> float | None:
    """Least distance from ``goal`` to the disc cut by ``rows``, from every point where an optimum can lie."""
    length = np.hypot(*goal)
    candidates = [goal if length <= RADIUS else goal * RADIUS / length]
    for n_x, n_y, bound in rows:
        n = np.array([n_x, n_y])
        candidates.append(goal + (bound - n @ goal) * n)
        room = RADIUS**2 - bound**2
        if room >= 0.0:
            candidates += [bound * n + s * math.sqrt(room) * np.array([n_y, -n_x]) for s in (-1.0, 1.0)]
    for one, two in itertools.combinations(rows, 2):
        pair = np.array([one[:2], two[:2]])
        if abs(np.linalg.det(pair)) > 1e-6:
            candidates.append(np.linalg.solve(pair, [one[2], two[2]]))
    kept = [
        np.hypot(*(c - goal))
        for c in candidates
        if np.hypot(*c) <= RADIUS + 1e-6 and all(rows[:, :2] @ c >= rows[:, 2] - 1e-6)
    ]
    return min(kept) if kept else None


def random_rows(rng: np.random.Generator, count: int) -> np.ndarray:
    angle = rng.uniform(-math.pi, math.pi, count)
    return np.column_stack([np.cos(angle), np.sin(angle), rng.uniform(-9.0, 9.0, count)])


@settings(max_examples=300, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 7))
def test_the_nearest_point_is_as_near_as_any(seed: int, count: int):
    rng = np.random.default_rng(seed)
    rows = random_rows(rng, count)
    goal = rng.uniform(-15.0, 15.0, 2)
    failed, x, y = nearest_point(count, rows, RADIUS, *goal, False)
    best = best_by_enumeration(rows, goal)
    if failed == count:
        assert best is not None
        assert math.hypot(x, y) <= RADIUS + 1e-6
        assert all(rows[:, :2] @ [x, y] >= rows[:, 2] - 1e-6)
        assert math.hypot(x - goal[0], y - goal[1]) == pytest.approx(best, abs=1e-5)
    else:
        rows[:, 2] += 1e-4
        assert best_by_enumeration(rows, goal) is None


@settings(max_examples=200, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(3, 6), hard=st.integers(0, 2))
def test_contradicting_rows_keep_the_hard_ones_and_share_the_rest_of_the_violation(
    seed: int, count: int, hard: int
):
    rng = np.random.default_rng(seed)
    rows = random_rows(rng, count)
    rows[:hard, 2] = -np.abs(rows[:hard, 2])  # hard rows that |a| = 0 keeps
    failed, x, y = nearest_point(count, rows, RADIUS, *rng.uniform(-12.0, 12.0, 2), False)
    if failed == count:
        return
    x, y = least_violation(failed, count, hard, rows, RADIUS, x, y)
    assert math.hypot(x, y) <= RADIUS + 1e-6
    assert all(rows[:hard, :2] @ [x, y] >= rows[:hard, 2] - 1e-6)
    worst = np.max(rows[hard:, 2] - rows[hard:, :2] @ [x, y])
    # No point of the hard region violates the soft rows less: relaxing all of them by less leaves nothing.
    relaxed = rows.copy()
    relaxed[hard:, 2] -= worst - 1e-3
    assert best_by_enumeration(relaxed, np.zeros(2)) is None


def test_a_neighbour_pressing_in_never_pushes_an_agent_into_the_wall():
    wall = discs((2.2, 0.0, 1.5))  # 0.7 m ahead
    pusher = neighbours((-0.6, 0.0, 5.0, 0.0))  # closes in from behind at 5 m/s
    a_x, _ = safety_filter((0.0, 0.0), (0.0, 0.0), pusher, wall, LIMITS)
    alone, _ = safety_filter((RADIUS, 0.0), (0.0, 0.0), NOBODY, wall, LIMITS)
    assert a_x <= alone + 1e-6


def test_the_same_situation_gets_the_same_bits():
    rng = np.random.default_rng(3)
    near = neighbours(*rng.uniform(-1.5, 1.5, (6, 4)))
    walls = discs((1.9, 0.3, 1.0), (-0.4, 2.2, 1.2))
    answers = {safety_filter((9.0, 5.0), (2.0, 1.0), near, walls, LIMITS) for _ in range(20)}
    assert len(answers) == 1


# --- hostile commands --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("believed", "real"), [(10.0, 10.0), (5.0, 5.0), (3.0, 3.0), (10.0, 5.0)])
def test_full_throttle_at_a_disc_stops_before_contact(believed, real):
    """Also drones that can do less, and know it or not."""
    p, v = np.array([0.0, 0.05]), np.zeros(2)
    least = math.inf
    for _ in range(800):
        towards = np.array([12.0, 0.0]) - p
        wish = 10.0 * towards / np.hypot(*towards)
        o_rel = np.array([[12.0, 0.0]]) - p
        seen = int(np.hypot(*o_rel[0]) - 1.5 < 6.0)
        disc = Discs(seen, o_rel, np.array([1.5]), np.zeros(1, np.int8))
        a = np.array(safety_filter(tuple(wish), tuple(v), NOBODY, disc, limits_for(believed, 0.5)))
        a *= min(1.0, real / max(np.hypot(*a), 1e-9))
        p += DT / 2 * (v + v + a * DT)
        v += a * DT
        v *= min(1.0, real / max(np.hypot(*v), 1e-9))
        least = min(least, np.hypot(12.0 - p[0], p[1]) - 1.5)
    assert 0.5 < least < 0.7


def test_a_mob_that_wants_one_point_does_not_collide():
    rng = np.random.default_rng(11)
    ring = np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False)
    p = 5.0 * np.column_stack([np.cos(ring), np.sin(ring)]) + rng.uniform(-0.3, 0.3, (8, 2))
    v = np.zeros_like(p)
    least = math.inf
    for _ in range(400):
        a = np.zeros_like(p)
        for i in range(8):
            others = [j for j in range(8) if j != i and np.hypot(*(p[j] - p[i])) < 6.0]
            rel = np.ascontiguousarray(p[others] - p[i])
            vel = np.ascontiguousarray(v[others] - v[i])
            a[i] = safety_filter(
                tuple(-8.0 * p[i]), tuple(v[i]), Neighbours(len(others), rel, vel), NOTHING, LIMITS
            )
            least = min(least, *np.hypot(*rel.T), math.inf)
        p += DT / 2 * (v + v + a * DT)
        v += a * DT
    assert least > 0.5
