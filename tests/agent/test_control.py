"""The analytic controller, told term by term, then a few short flights."""

import math

import numpy as np
import pytest

from agent.control.agents import agent_terms, pair_term
from agent.control.attraction import Aim, attraction, heading, saturated
from agent.control.fusion import apf_blend, risk_weight
from agent.control.gains import GAINS, gains_for, limits_for
from agent.control.obstacles import LEFT, RIGHT, choose_side, cluster_of, obstacle_term, obstacle_terms
from agent.control.safety import safety_filter
from agent.control.surroundings import Discs, Neighbours
from agent.control.tracking import required_acceleration, smooth_acceleration
from agent.policy.analytic_kernel import analytic

DT = 0.01
AHEAD = (1.0, 0.0)


def around(*rows: tuple[float, float, float]) -> Discs:
    """Discs given as (x, y, radius), relative to the agent, not yet passed on any side."""
    table = np.array(rows, float)
    return Discs(len(rows), table[:, :2].copy(), table[:, 2].copy(), np.zeros(len(rows), np.int8))


def aim(
    error: tuple[float, float],
    target_velocity: tuple[float, float],
    velocity: tuple[float, float] = (3.0, 0.0),
) -> Aim:
    """Chain and slot target at one place."""
    return Aim(error, error, velocity, target_velocity)


# --- attraction --------------------------------------------------------------------------------------------


def test_saturation_keeps_the_direction_and_caps_the_length():
    assert saturated(0.3, 0.4, 1.0) == (0.3, 0.4)
    assert saturated(30.0, 40.0, 1.0) == pytest.approx((0.6, 0.8))


def test_an_agent_in_its_slot_at_the_targets_speed_is_left_alone():
    assert attraction(aim((0.0, 0.0), (3.0, 0.0)), GAINS) == (0.0, 0.0)


def test_far_slots_do_not_pull_harder_than_the_reach():
    near, _ = attraction(Aim((0.0, 0.0), (GAINS.slot_reach, 0.0), (3.0, 0.0), (3.0, 0.0)), GAINS)
    far, _ = attraction(Aim((0.0, 0.0), (50.0, 0.0), (3.0, 0.0), (3.0, 0.0)), GAINS)
    assert near == pytest.approx(far) == pytest.approx(GAINS.slot_pull * GAINS.slot_reach)


def test_the_heading_looks_along_the_targets_motion_even_in_the_slot():
    assert heading(aim((0.0, 0.0), (3.0, 0.0)), GAINS) == (1.0, 0.0)
    assert heading(aim((0.0, 0.0), (0.0, -2.0)), GAINS) == (0.0, -1.0)
    u_x, u_y = heading(aim((0.0, 2.0), (3.0, 0.0)), GAINS)
    assert math.hypot(u_x, u_y) == pytest.approx(1.0)
    assert u_x > u_y > 0.0


# --- agents ------------------------------------------------------------------------------------------------


def test_a_distant_neighbour_at_rest_relative_to_me_does_not_matter():
    assert pair_term((5.0, 0.0), (0.0, 0.0), AHEAD, GAINS) == (0.0, 0.0)


def test_two_agents_push_each_other_apart_alike():
    mine = pair_term((0.0, 0.9), (0.0, 0.0), AHEAD, GAINS)
    theirs = pair_term((0.0, -0.9), (0.0, 0.0), AHEAD, GAINS)
    assert mine[1] < 0.0
    assert mine == pytest.approx((-theirs[0], -theirs[1]))


def test_the_push_grows_without_bound_towards_contact():
    pushes = [-pair_term((0.0, d), (0.0, 0.0), AHEAD, GAINS)[1] for d in (1.2, 0.9, 0.7, 0.55, 0.51)]
    assert pushes == sorted(pushes)
    assert pushes[-1] > 10.0


def test_agents_on_a_collision_course_step_to_opposite_sides_even_when_aimed_exactly():
    mine = pair_term((4.0, 0.0), (-4.0, 0.0), AHEAD, GAINS)
    theirs = pair_term((-4.0, 0.0), (4.0, 0.0), (-1.0, 0.0), GAINS)
    assert mine[0] < 0.0 < theirs[0]
    assert abs(mine[1]) > 0.1
    assert mine[1] == pytest.approx(-theirs[1])


def test_who_gives_way_at_close_quarters_steps_to_the_same_hand_whatever_its_heading():
    for angle in (0.0, 1.0, 2.5, -2.0):
        u_x, u_y = math.cos(angle), math.sin(angle)
        a_x, a_y = pair_term((1.3 * u_x, 1.3 * u_y), (0.0, 0.0), (u_x, u_y), GAINS)
        assert u_x * a_y - u_y * a_x < 0.0  # to the right of the heading


def test_nobody_gives_way_to_one_behind():
    ahead, behind = (
        pair_term((1.1, 0.0), (0.0, 0.0), AHEAD, GAINS),
        pair_term((-1.1, 0.0), (0.0, 0.0), AHEAD, GAINS),
    )
    assert ahead[1] < 0.0
    assert behind == (-ahead[0], 0.0)


def test_a_later_conflict_counts_less_by_its_time_constant():
    gains = GAINS._replace(agent_brake=0.0)
    soon, later = (pair_term((3.0 * s, -0.3), (-3.0, 0.0), AHEAD, gains) for s in (1.0, 1.5))
    assert soon[1] == pytest.approx(
        gains.predict_gain * 3.0 * (1.0 - 0.3 / gains.predict_radius) * math.exp(-1.0 / gains.predict_time)
    )
    assert later[1] / soon[1] == pytest.approx(math.exp(-0.5 / gains.predict_time))


def test_neighbours_add_up_and_rows_beyond_the_count_are_not_read():
    rel = np.array([[0.9, 0.2], [-0.4, 1.0], [np.nan, np.nan]])
    vel = np.array([[-1.0, 0.0], [0.3, 0.4], [np.nan, np.nan]])
    parts = [pair_term(tuple(rel[j]), tuple(vel[j]), AHEAD, GAINS) for j in range(2)]
    assert agent_terms(Neighbours(2, rel, vel), AHEAD, GAINS) == pytest.approx(tuple(np.sum(parts, axis=0)))


# --- obstacles ---------------------------------------------------------------------------------------------


def test_narrow_gaps_link_obstacles_into_one_cluster_transitively():
    discs = around((5.0, 0.0, 1.0), (5.0, 8.0, 1.0), (5.0, 4.0, 1.0), (20.0, 0.0, 1.0))
    assert cluster_of(0, discs, 2.1) == 0b0111
    assert cluster_of(3, discs, 2.1) == 0b1000
    assert cluster_of(0, discs, 1.9) == 0b0001


def test_a_cluster_is_passed_where_it_reaches_less_far_and_as_a_whole():
    discs = around((4.0, 0.3, 1.0), (4.0, -2.9, 1.0), (4.0, -6.1, 1.0))
    cluster = cluster_of(0, discs, GAINS.cluster_gap)
    assert choose_side(cluster, discs, AHEAD, GAINS) == LEFT
    assert discs.side[0] == discs.side[1] == LEFT
    # Alone, the first disc would have been passed on the right.
    assert choose_side(0b001, around((4.0, 0.3, 1.0)), AHEAD, GAINS) == RIGHT


def test_an_obstacle_beside_the_lane_or_behind_is_not_passed_on_any_side():
    for x, y in ((3.0, 2.5), (3.0, -2.5), (-3.0, 0.0)):
        discs = around((x, y, 1.0))
        assert choose_side(1, discs, AHEAD, GAINS) == 0
        assert discs.side[0] == 0


def test_a_side_once_chosen_holds_until_the_other_is_shorter_by_the_loyalty():
    gains = GAINS._replace(side_loyalty=1.0)
    discs = around((4.0, -0.1, 1.0))
    assert choose_side(1, discs, AHEAD, gains) == LEFT
    discs.rel[0, 1] = 0.4  # right is now shorter by 0.8 m
    assert choose_side(1, discs, AHEAD, gains) == LEFT
    discs.rel[0, 1] = 0.6  # by 1.2 m
    assert choose_side(1, discs, AHEAD, gains) == RIGHT


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_cluster_takes_over_the_side_of_its_nearest_member(order):
    near, far = (-2.5, 0.0, 1.0), (-4.0, 1.0, 1.0)
    discs = around(*((near, far)[index] for index in order))
    discs.side[:] = [(LEFT, RIGHT)[index] for index in order]
    assert choose_side(0b11, discs, AHEAD, GAINS) == 0, "it lies behind"
    assert discs.side.tolist() == [LEFT, LEFT]


def test_a_side_is_forgotten_once_the_obstacle_is_out_of_memory_range():
    discs = around((-1.0 - GAINS.obstacle_range - GAINS.keep_side - 0.1, 0.0, 1.0))
    discs.side[0] = LEFT
    assert obstacle_terms(discs, (3.0, 0.0), AHEAD, (1.0, 0.0), GAINS) == (0.0, 0.0)
    assert discs.side[0] == 0


def test_an_obstacle_out_of_range_does_not_matter():
    assert obstacle_term((9.0, 0.0), 1.0, 0, (3.0, 0.0), AHEAD, (5.0, 0.0), GAINS) == (0.0, 0.0)


def test_a_blocking_obstacle_leads_around_itself_and_holds_back_the_pull_into_it():
    free = obstacle_term((3.0, 0.0), 1.0, 0, (0.0, 0.0), AHEAD, (5.0, 0.0), GAINS)
    left = obstacle_term((3.0, 0.0), 1.0, LEFT, (0.0, 0.0), AHEAD, (5.0, 0.0), GAINS)
    right = obstacle_term((3.0, 0.0), 1.0, RIGHT, (0.0, 0.0), AHEAD, (5.0, 0.0), GAINS)
    assert free[1] == 0.0
    assert left[1] > 0.0 > right[1]
    assert left[1] == pytest.approx(-right[1])
    assert left[0] < free[0] < 0.0


def test_braking_counts_only_towards_the_obstacle():
    away = obstacle_term((3.0, 0.0), 1.0, 0, (-4.0, 0.0), AHEAD, (0.0, 0.0), GAINS)
    still = obstacle_term((3.0, 0.0), 1.0, 0, (0.0, 0.0), AHEAD, (0.0, 0.0), GAINS)
    towards = obstacle_term((3.0, 0.0), 1.0, 0, (4.0, 0.0), AHEAD, (0.0, 0.0), GAINS)
    assert towards[0] < still[0] == away[0]


# --- fusion and tracking -----------------------------------------------------------------------------------


def test_the_nearer_of_agent_and_obstacle_decides_the_risk():
    assert risk_weight(math.inf, math.inf, 1.5) == 0.0
    assert risk_weight(0.75, math.inf, 1.5) == pytest.approx(0.5)
    assert risk_weight(0.75, 0.3, 1.5) == pytest.approx(0.8)
    assert risk_weight(0.75, -0.1, 1.5) == 1.0


def test_fusion_goes_from_tracking_to_the_reactive_controller():
    assert apf_blend(1.0, 2.0, -3.0, 4.0, math.inf, math.inf, 1.5) == (1.0, 2.0)
    assert apf_blend(1.0, 2.0, -3.0, 4.0, math.inf, 0.0, 1.5) == (-3.0, 4.0)
    assert apf_blend(1.0, 2.0, -3.0, 4.0, 0.75, math.inf, 1.5) == pytest.approx((-1.0, 3.0))


def test_the_papers_acceleration_reaches_the_point_in_one_step_of_the_dynamics():
    v = np.array([3.0, -1.0])
    r = np.array([0.031, -0.0105])
    a = np.array(required_acceleration(*r, *v, DT))
    assert DT / 2 * (v + (v + a * DT)) == pytest.approx(r)


def test_the_papers_acceleration_never_forgets_a_disturbance_the_smooth_one_does():
    def speed_error_after(steps: int, smooth: bool) -> float:
        p, v = 0.0, 3.1  # the reference moves at 3 m/s from 0
        for tick in range(steps):
            if smooth:
                a, _ = smooth_acceleration(3.0 * DT * tick - p, 0.0, 3.0 - v, 0.0, 0.0, 0.0)
            else:
                a, _ = required_acceleration(3.0 * DT * (tick + 1) - p, 0.0, v, 0.0, DT)
            p += DT / 2 * (v + (v + a * DT))
            v += a * DT
        return abs(v - 3.0)

    assert speed_error_after(200, smooth=False) == pytest.approx(0.1)
    assert speed_error_after(200, smooth=True) < 1e-3


# --- flights -----------------------------------------------------------------------------------------------


def fly(
    start: list[tuple[float, float]],
    slots: list[tuple[float, float]],
    obstacles: list[tuple[float, float, float]],
    seconds: float,
    collision_m: float = GAINS.contact_m,
) -> tuple[np.ndarray, float, float]:
    """Fly with perfect sensing: final slot errors (N,), least distance of a pair, least of a surface."""
    p = np.array(start, float)
    v = np.zeros_like(p)
    offset = np.array(slots, float)
    count = len(p)
    table = np.array(obstacles, float).reshape(-1, 3)
    side = np.zeros((count, len(table)), np.int8)
    v_target = np.array([3.0, 0.0])
    apart, clear = math.inf, math.inf
    for tick in range(round(seconds / DT)):
        target = offset + v_target * DT * tick
        a = np.zeros_like(p)
        for i in range(count):
            others = [j for j in range(count) if j != i and np.hypot(*(p[j] - p[i])) < 6.0]
            rel = np.ascontiguousarray(p[others] - p[i])
            vel = np.ascontiguousarray(v[others] - v[i])
            o_rel = np.ascontiguousarray(table[:, :2] - p[i])
            radius = np.ascontiguousarray(table[:, 2])
            near, discs = Neighbours(len(others), rel, vel), Discs(len(table), o_rel, radius, side[i])
            error = tuple(target[i] - p[i])
            wish = analytic(aim(error, (3.0, 0.0), tuple(v[i])), near, discs, gains_for(collision_m))
            a[i] = safety_filter(wish, tuple(v[i]), near, discs, limits_for(10.0, collision_m))
            apart = min(apart, *np.hypot(*rel.T), math.inf)
            clear = min(clear, *(np.hypot(*o_rel.T) - radius), math.inf)
        p += DT / 2 * (v + v + a * DT)
        v += a * DT
    return np.hypot(*(offset + v_target * DT * round(seconds / DT) - p).T), apart, clear


def test_alone_in_the_open_it_settles_in_its_slot():
    error, _, _ = fly([(-4.0, 3.0)], [(0.0, 0.0)], [], 8.0)
    assert error[0] < 0.1


def test_it_flies_around_a_disc_dead_ahead():
    error, _, clear = fly([(0.0, 0.0)], [(0.0, 0.0)], [(12.0, 0.0, 2.0)], 11.0)
    assert clear > 0.5
    assert error[0] < 0.25


def test_it_leaves_a_pocket_of_three_discs():
    pocket = [(14.0, 0.0, 2.0), (12.0, 3.5, 1.5), (12.0, -3.2, 1.5)]
    error, _, clear = fly([(0.0, 0.0)], [(0.0, 0.0)], pocket, 14.0)
    assert clear > 0.5
    assert error[0] < 0.25


@pytest.mark.parametrize("collision_m", [0.2, 0.5, 0.9, 1.2])
def test_agents_that_must_trade_places_pass_each_other(collision_m):
    error, apart, _ = fly([(5.0, 0.0), (0.0, 0.0)], [(0.0, 0.0), (5.0, 0.0)], [], 8.0, collision_m)
    assert apart > collision_m
    assert max(error) < 0.25


@pytest.mark.parametrize("collision_m", [0.2, 0.5, 0.9, 1.2])
def test_obstacles_are_passed_beyond_the_distance_at_which_one_collides_with_them(collision_m):
    pocket = [(14.0, 0.0, 2.0), (12.0, 3.5, 1.5), (12.0, -3.2, 1.5)]
    error, _, clear = fly([(0.0, 0.0)], [(0.0, 0.0)], pocket, 15.0, collision_m)
    assert collision_m < clear < collision_m + 0.9
    assert error[0] < 0.25


def test_the_gains_of_the_usual_contact_distance_are_the_ones_that_were_found():
    assert gains_for(0.5) == GAINS


def test_a_row_of_agents_reassembles_behind_an_obstacle():
    slots = [(0.0, 0.0), (0.0, 5.0), (-5.0, 0.0), (-5.0, 5.0)]
    error, apart, clear = fly(slots, slots, [(12.0, 1.0, 1.8)], 11.0)
    assert min(apart, clear) > 0.5
    assert max(error) < 0.25
