"""The paper's potential field: what each of its three terms does, and that nothing else is in it."""

import numpy as np
import pytest

from agent.control.apf import (
    APF,
    apf_for,
    expert,
    formation_term,
    goal_term,
    obstacle_term,
    safety_controller,
)
from agent.control.attraction import Aim
from agent.control.surroundings import Discs, Neighbours

TARGET = (3.0, 0.0)
NOBODY = Neighbours(0, np.zeros((0, 2)), np.zeros((0, 2)))
NOTHING = Discs(0, np.zeros((0, 2)), np.zeros(0), np.zeros(0, np.int8))


def aim(chain: tuple[float, float] = (0.0, 0.0), slot: tuple[float, float] = (0.0, 0.0)) -> Aim:
    return Aim(chain, slot, TARGET, TARGET)


def disc(x: float, y: float, radius: float = 1.0) -> Discs:
    return Discs(1, np.array([[x, y]]), np.array([radius]), np.zeros(1, np.int8))


def drone(x: float, y: float) -> Neighbours:
    return Neighbours(1, np.array([[x, y]]), np.zeros((1, 2)))


def test_who_is_in_its_place_and_moves_as_all_do_is_left_alone() -> None:
    assert expert(aim(), TARGET, NOBODY, NOTHING, APF) == (0.0, 0.0)
    assert expert(aim(), TARGET, drone(5.0, 0.0), disc(20.0, 0.0), APF) == (0.0, 0.0)


def test_the_leader_pulls_and_the_goal_pulls_and_neither_pulls_without_end() -> None:
    assert formation_term(aim(chain=(0.1, 0.0)), TARGET, NOBODY, APF)[0] == pytest.approx(0.1 * APF.form_pull)
    far, further = (formation_term(aim(chain=(x, 0.0)), TARGET, NOBODY, APF) for x in (50.0, 500.0))
    assert far == further == pytest.approx((APF.form_pull * APF.form_reach, 0.0))
    assert goal_term(aim(slot=(0.0, -0.1)), APF)[1] == pytest.approx(-0.1 * APF.goal_pull)


def test_a_drone_is_held_to_its_leaders_velocity() -> None:
    a_x, a_y = formation_term(aim(), (3.0, 1.0), NOBODY, APF)
    assert (a_x, a_y) == pytest.approx((0.0, APF.form_damping))


def test_drones_repel_each_other_the_more_the_nearer_and_not_from_afar() -> None:
    pushes = [formation_term(aim(), TARGET, drone(d, 0.0), APF)[0] for d in (0.6, 1.2, APF.morse_range)]
    assert pushes[0] < pushes[1] < 0.0
    assert pushes[2] == 0.0


def test_an_obstacle_repels_and_its_robot_slides_along() -> None:
    still, along, into = ((0.0, 0.0), (0.0, 2.0), (2.0, 0.0))
    at_rest = obstacle_term(disc(2.0, 0.0), still, APF)
    assert at_rest[0] < 0.0 == at_rest[1]
    assert obstacle_term(disc(2.0, 0.0), into, APF)[0] < at_rest[0], "it is damped against the surface"
    sliding = obstacle_term(disc(2.0, 0.0), along, APF)
    assert sliding[0] == at_rest[0]
    assert 0.0 > sliding[1] > obstacle_term(disc(2.0, 0.0), into, APF)[0] - at_rest[0], "half, along it"


def test_two_obstacles_without_a_way_between_them_turn_a_drone_aside_like_one() -> None:
    both = Discs(2, np.array([[2.3, 1.45], [2.3, -1.55]]), np.array([1.5, 1.5]), np.zeros(2, np.int8))
    a_x, a_y = obstacle_term(both, (0.0, 0.0), APF)  # the drone is 5 cm off their middle, to the left
    assert a_x < -APF.goal_pull * APF.goal_reach, "the goal pulls it no nearer"
    assert a_y > 0.0


def test_the_safety_controller_knows_neither_formation_nor_drones() -> None:
    off = aim(chain=(9.0, 9.0), slot=(1.0, 0.5))
    (o_x, o_y), (g_x, g_y) = obstacle_term(disc(2.0, 0.5), TARGET, APF), goal_term(off, APF)
    assert safety_controller(off, disc(2.0, 0.5), APF) == (o_x + g_x, o_y + g_y)


def test_larger_drones_begin_to_keep_apart_earlier() -> None:
    wide = apf_for(0.9)
    assert (
        wide.morse_range - APF.morse_range
        == pytest.approx(wide.obstacle_range - APF.obstacle_range)
        == pytest.approx(0.4)
    )
