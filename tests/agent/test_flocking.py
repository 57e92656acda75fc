"""Olfati-Saber's terms, one by one, and a flight of the policy made of them."""

import math

import numpy as np
import pytest

from agent.control.flocking import Flocking, alpha_term, beta_term, bump, flocking, gamma_term, sigma_norm
from agent.control.surroundings import Discs, Neighbours
from protocols.mission.document import parse_mission
from rsc_swarm.flight.simulate import simulate

GAINS = Flocking(spacing_m=5.0, range_m=6.0)


def test_the_sigma_norm_is_smooth_at_zero_and_grows_like_the_distance_far_out():
    assert sigma_norm(0.0, 0.1) == 0.0
    assert sigma_norm(1e-3, 0.1) == pytest.approx(0.5e-6, rel=1e-3)
    assert sigma_norm(101.0, 0.1) - sigma_norm(100.0, 0.1) == pytest.approx(1 / math.sqrt(0.1), rel=1e-3)


def test_the_bump_fades_from_one_to_nothing():
    assert bump(0.1, 0.2) == 1.0
    assert bump(0.6, 0.2) == pytest.approx(0.5)
    assert bump(1.0, 0.2) == bump(1.5, 0.2) == 0.0
    assert bump(0.2, 0.2) == pytest.approx(1.0)


def test_neighbours_at_the_spacing_of_the_lattice_leave_each_other_alone():
    assert alpha_term(5.0, 0.0, 0.0, 0.0, GAINS) == pytest.approx((0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize("limits", [(1.0, 5.0), (3.0, 3.0)])
def test_nearer_ones_repel_and_farther_ones_attract(limits: tuple[float, float]):
    gains = GAINS._replace(attraction_limit=limits[0], repulsion_limit=limits[1])
    away, aside = alpha_term(3.0, 0.0, 0.0, 0.0, gains)
    towards, _ = alpha_term(5.5, 0.0, 0.0, 0.0, gains)
    assert away < 0.0 < towards
    assert aside == 0.0


def test_neighbours_agree_on_a_velocity_and_two_of_them_push_each_other_alike():
    mine = np.array(alpha_term(2.0, 1.0, 0.5, -0.5, GAINS))
    theirs = np.array(alpha_term(-2.0, -1.0, -0.5, 0.5, GAINS))
    assert mine == pytest.approx(-theirs)
    still = np.array(alpha_term(2.0, 1.0, 0.0, 0.0, GAINS))
    follow = mine - still
    assert follow[0] == pytest.approx(-follow[1])
    assert follow[0] > 0.0


def test_beyond_its_range_nobody_matters():
    assert alpha_term(6.0, 0.1, 3.0, 3.0, GAINS) == (0.0, 0.0)
    beyond = 1.0 + GAINS.beta_range_m + 0.01
    assert beta_term(beyond, 0.0, 1.0, 3.0, 3.0, GAINS) == (0.0, 0.0)


def test_an_obstacle_pushes_back_the_more_the_nearer_its_surface_is():
    far, near = (beta_term(1.5 + d, 0.0, 1.5, 0.0, 0.0, GAINS) for d in (0.9 * GAINS.beta_range_m, 1.0))
    assert near[0] < far[0] < 0.0
    assert near[1] == far[1] == 0.0


def test_an_obstacle_brakes_what_flies_into_it_more_than_what_flies_along_it():
    gains = GAINS._replace(beta_fade=0.9)  # so that it counts fully at 1 m
    still, into, along = (beta_term(2.5, 0.0, 1.5, *v, gains) for v in ((0.0, 0.0), (2.0, 0.0), (0.0, 2.0)))
    brake, drag = still[0] - into[0], still[1] - along[1]
    assert brake == pytest.approx(2.0 * gains.beta_consensus)
    assert drag == pytest.approx(brake * (1.0 - 1.5 / 2.5)), "its beta-agent slides along"


def test_the_virtual_leader_pulls_no_harder_from_afar():
    near, _ = gamma_term(1.0, 0.0, 0.0, 0.0, GAINS)
    far, _ = gamma_term(1e6, 0.0, 0.0, 0.0, GAINS)
    assert near < far == pytest.approx(GAINS.gamma_pull)
    assert gamma_term(0.0, 0.0, 1.0, -1.0, GAINS) == (GAINS.gamma_damping, -GAINS.gamma_damping)


def test_all_terms_add_up_and_rows_beyond_the_counts_are_not_read():
    rel, vel = np.array([[2.0, 1.0], [np.nan, np.nan]]), np.array([[0.1, 0.2], [np.nan, np.nan]])
    o_rel, o_radius = np.array([[2.5, 0.5], [np.nan, np.nan]]), np.array([1.5, np.nan])
    near, discs = Neighbours(1, rel, vel), Discs(1, o_rel, o_radius, np.zeros(2, np.int8))
    total = flocking(near, discs, (1.0, 2.0), (7.0, -3.0), (3.0, 0.0), GAINS)
    parts = [
        alpha_term(2.0, 1.0, 0.1, 0.2, GAINS),
        beta_term(2.5, 0.5, 1.5, 1.0, 2.0, GAINS),
        gamma_term(7.0, -3.0, 2.0, -2.0, GAINS),
    ]
    assert total == pytest.approx(tuple(np.sum(parts, axis=0)))


@pytest.mark.parametrize("filtered", [True, False])
def test_saber_brings_nine_drones_into_formation_in_the_open(filtered: bool):
    mission = {"agents": 9, "policy": "saber", "safety_filter": filtered, "obstacles": {"discs": []}}
    outcome = simulate([parse_mission(mission)])[0]
    assert outcome.success, outcome
