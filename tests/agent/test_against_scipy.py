"""The numbers we compute ourselves, against a library that computes them in another way."""

import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.optimize import approx_fprime, minimize
from scipy.stats import binom, binomtest, kstest

from agent.control.flocking import Flocking, alpha_term, beta_term, gamma_term, sigma_norm, sigmoid
from agent.control.halfplanes import least_violation, nearest_point
from agent.control.tracking import required_acceleration, smooth_acceleration
from rsc_swarm.study.intervals import failure_bound, wilson
from world.medium import chance

RADIUS = 10.0
SEEDS = st.integers(0, 2**32 - 1)
GAINS = Flocking(spacing_m=5.0, range_m=6.0)

few = settings(max_examples=60, deadline=None)


def some_rows(rng: np.random.Generator, count: int) -> np.ndarray:
    """Half-planes ``n . a >= bound``."""
    angle = rng.uniform(-math.pi, math.pi, count)
    return np.column_stack([np.cos(angle), np.sin(angle), rng.uniform(-9.0, 9.0, count)])


def least_common_violation(rows: np.ndarray, hard: int) -> float:
    """By how much the worst of the rows after ``hard`` must be broken at least, within the disc (a cone program)."""
    soft = np.arange(len(rows)) >= hard
    constraints = [
        {"type": "ineq", "fun": lambda a: rows[:, :2] @ a[:2] + soft * a[2] - rows[:, 2]},
        {"type": "ineq", "fun": lambda a: RADIUS**2 - a[0] ** 2 - a[1] ** 2},
    ]
    tries = [
        minimize(lambda a: a[2], (*start, 20.0), constraints=constraints, options={"maxiter": 500})
        for start in ((0.0, 0.0), (5.0, 5.0), (-5.0, -5.0))
    ]
    found = [attempt.fun for attempt in tries if attempt.success]
    assume(found)
    return float(min(found))


@few
@given(seed=SEEDS, count=st.integers(1, 8))
def test_the_nearest_point_is_the_quadratic_programs(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    rows, goal = some_rows(rng, count), rng.uniform(-15.0, 15.0, 2)
    kept, x, y = nearest_point(count, rows, RADIUS, *goal, False)
    spare = -least_common_violation(rows, 0)
    if kept < count:
        assert spare < 1e-5, "there is no such point"
        return
    assume(spare > 1e-3)  # else the program's own tolerance decides
    program = minimize(
        lambda a: np.sum((a - goal) ** 2), (x, y), jac=lambda a: 2 * (a - goal),
        constraints=[
            {"type": "ineq", "fun": lambda a: rows[:, :2] @ a - rows[:, 2]},
            {"type": "ineq", "fun": lambda a: RADIUS**2 - a @ a},
        ],
    )  # fmt: skip
    assume(program.success)
    assert math.dist((x, y), goal) <= math.dist(program.x, goal) + 1e-5
    assert np.all(rows[:, :2] @ (x, y) >= rows[:, 2] - 1e-6)
    assert math.hypot(x, y) <= RADIUS + 1e-6


@few
@given(seed=SEEDS, count=st.integers(3, 8), hard=st.integers(0, 2))
@example(seed=636960790, count=5, hard=0)
def test_the_least_violation_is_the_cone_programs(seed: int, count: int, hard: int) -> None:
    rng = np.random.default_rng(seed)
    rows = some_rows(rng, count)
    rows[:hard, 2] = -np.abs(rows[:hard, 2])  # which (0, 0) keeps
    kept, x, y = nearest_point(count, rows, RADIUS, *rng.uniform(-15.0, 15.0, 2), False)
    assume(kept < count)
    x, y = least_violation(kept, count, hard, rows, RADIUS, x, y)
    worst = np.max(rows[hard:, 2] - rows[hard:, :2] @ (x, y))
    assert (
        worst <= least_common_violation(rows, hard) + 1e-4
    )  # the library's solver may stop a little short of the least
    assert np.all(rows[:hard, :2] @ (x, y) >= rows[:hard, 2] - 1e-6)
    assert math.hypot(x, y) <= RADIUS + 1e-6


VECTOR = st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))


@few
@given(r=VECTOR, v=VECTOR)
def test_the_required_acceleration_arrives(r: tuple[float, float], v: tuple[float, float]) -> None:
    """Held for one step, it brings a drone to the point; the equations of motion are integrated by a library."""
    dt = 0.1
    a = required_acceleration(*r, *v, dt)
    motion = solve_ivp(lambda _, s: [*s[2:], *a], (0.0, dt), [0.0, 0.0, *v], rtol=1e-10, atol=1e-12)
    assert motion.y[:2, -1] == pytest.approx(r, abs=1e-7)


def test_the_smooth_tracking_is_critically_damped() -> None:
    """The error dies as (1 + t / tau) exp(-t / tau) with tau = 0.2 s, whatever the trajectory's own acceleration is."""
    moment = np.linspace(0.0, 1.5, 16)

    def derivative(t: float, state: np.ndarray) -> list[float]:
        forward = (math.sin(t), -1.0)
        p, v, p_ref, v_ref = state.reshape(4, 2)
        return [*v, *smooth_acceleration(*(p_ref - p), *(v_ref - v), *forward), *v_ref, *forward]

    start = [0.0, 0.0, 0.5, 0.0, 1.0, -2.0, 0.5, 0.0]
    motion = solve_ivp(derivative, (0.0, 1.5), start, t_eval=moment, rtol=1e-10, atol=1e-12).y
    error = motion[4:6] - motion[0:2]
    fading = (1.0 + 5.0 * moment) * np.exp(-5.0 * moment)
    np.testing.assert_allclose(error, np.outer([1.0, -2.0], fading), atol=1e-7)


@few
@given(distance=st.floats(0.3, 5.9), angle=st.floats(-3.0, 3.0))
def test_neighbours_pull_down_the_potential_of_the_article(distance: float, angle: float) -> None:
    """u_alpha = -c1 grad psi_alpha, psi_alpha the integral of phi_alpha over the sigma-norm (Olfati-Saber, eq. 17 and 23)."""
    g = GAINS
    reach, rest = (sigma_norm(length, g.epsilon) for length in (g.range_m, g.spacing_m))
    c = abs(g.attraction_limit - g.repulsion_limit) / math.sqrt(4 * g.attraction_limit * g.repulsion_limit)

    def force(z: float) -> float:
        share = z / reach
        fade = (
            1.0
            if share < g.alpha_fade
            else 0.5 * (1 + math.cos(math.pi * (share - g.alpha_fade) / (1 - g.alpha_fade)))
        )
        a, b = g.attraction_limit, g.repulsion_limit
        return fade * 0.5 * ((a + b) * sigmoid(z - rest + c) + a - b)

    def potential(mine: np.ndarray, other: np.ndarray) -> float:
        return quad(force, rest, sigma_norm(float(np.linalg.norm(other - mine)), g.epsilon), limit=200)[0]

    other = distance * np.array([math.cos(angle), math.sin(angle)])
    expected = -g.alpha_pull * approx_fprime(np.zeros(2), potential, 1e-6, other)
    assert alpha_term(*other, 0.0, 0.0, g) == pytest.approx(expected, rel=1e-3, abs=1e-3)


def test_the_virtual_leader_pulls_down_its_potential() -> None:
    """c1 grad (sqrt(1 + |z|²) - 1); and what is relative in velocity is damped."""
    leader, velocity = np.array([3.0, -4.0]), np.array([0.5, 0.25])
    slope = approx_fprime(np.zeros(2), lambda mine: math.sqrt(1 + np.sum((leader - mine) ** 2)), 1e-7)
    expected = -GAINS.gamma_pull * slope + GAINS.gamma_damping * velocity
    assert gamma_term(*leader, *velocity, GAINS) == pytest.approx(expected, rel=1e-5)


def test_an_obstacle_is_a_neighbour_that_slides_along_its_surface() -> None:
    """The velocity of the beta-agent is that of the point of the surface nearest to me, as that moves when I do."""
    centre, radius, mine = np.array([2.5, 1.0]), 1.0, np.array([1.2, -0.7])

    def nearest(p: np.ndarray) -> np.ndarray:
        return np.asarray(centre + radius * (p - centre) / np.linalg.norm(p - centre))

    slides = np.array([approx_fprime(np.zeros(2), lambda p, i=i: nearest(p)[i], 1e-7) for i in (0, 1)]) @ mine
    gains = GAINS._replace(
        beta_push=0.0, beta_consensus=1.0, beta_fade=0.999
    )  # counts fully, and does not push
    assert beta_term(*centre, radius, *mine, gains) == pytest.approx(slides - mine, rel=1e-5)


@given(runs=st.integers(1, 3000), share=st.floats(0.0, 1.0))
@settings(max_examples=40, deadline=None)
def test_intervals_are_the_librarys(runs: int, share: float) -> None:
    successes = round(share * runs)
    interval = binomtest(successes, runs).proportion_ci(0.95, method="wilson")
    assert wilson(successes, runs) == pytest.approx((interval.low, interval.high), abs=1e-6)
    assert binom.cdf(0, runs, failure_bound(runs)) == pytest.approx(0.05)


def test_chance_is_uniform_and_the_draws_of_two_links_are_strangers() -> None:
    draws = np.array(
        [[chance.uniform(7, chance.LOSS, source, 3, tick) for tick in range(4000)] for source in (1, 2)]
    )
    assert kstest(draws.ravel(), "uniform").pvalue > 0.01
    assert abs(np.corrcoef(draws)[0, 1]) < 0.05
