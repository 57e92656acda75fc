"""Whoever looks along the order of x finds what whoever looks at every pair finds."""

from itertools import combinations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from protocols.wire.sensed import MAX_NEAR, empty_sensed
from world.order import any_order
from world.plant import Bodies, Ground, sense
from world.referee import Standard, empty_findings, judge

REACH_M = 6.0
GROUND = Ground(np.array([0.0]), np.array([0]), np.zeros((1, 1, 3)))
ACTIVE = np.ones(1, np.bool_)


def bodies(places: NDArray[np.float64], flying: NDArray[np.bool_]) -> Bodies:
    agents = len(places)
    still = np.zeros((1, agents, 2))
    velocity = np.round(places[::-1] / 2)[None].copy()
    # In no order: whatever it was before must not matter.
    order = any_order(1, agents)[:, ::-1].copy()
    return Bodies(flying[None].copy(), places[None].copy(), velocity, still, np.ones((1, agents)), order)


@st.composite
def swarms(draw: st.DrawFn) -> Bodies:
    """Drones at whole metres, so that many are equally far from each other, and some in the same place."""
    agents, side = draw(st.integers(1, 70)), draw(st.integers(0, 40))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return bodies(rng.integers(-side, side + 1, (agents, 2)).astype(float), rng.random(agents) < 0.9)


@given(swarms())
def test_a_drone_senses_all_that_fly_within_reach_by_rising_number(swarm: Bodies) -> None:
    sensed, (position,), (velocity,), (flying,) = (
        empty_sensed(len(swarm.flying[0])),
        *swarm[1:3],
        swarm.flying,
    )
    sense(ACTIVE, swarm, GROUND, REACH_M, True, sensed)
    for agent in np.flatnonzero(flying).tolist():
        away = np.linalg.norm(position - position[agent], axis=1)
        near = [other for other in np.flatnonzero((away <= REACH_M) & flying).tolist() if other != agent]
        seen = sensed.near[agent, : sensed.near_count[agent]]
        assert seen["number"].tolist() == near[:MAX_NEAR]
        for one in seen:
            assert [one["x"], one["y"]] == (position[one["number"]] - position[agent]).tolist()
            assert [one["vx"], one["vy"]] == (velocity[one["number"]] - velocity[agent]).tolist()


@given(swarms())
def test_the_nearest_two_are_found_and_of_several_those_with_the_lowest_numbers(swarm: Bodies) -> None:
    (position,), (flying,) = swarm.position, swarm.flying
    agents = len(flying)
    parent = np.full(agents, -1, np.int16)
    found = empty_findings(1, agents)
    standard = Standard(np.zeros((agents, 2)), parent, 5.0, 0.1, 0.5, True)
    judge(ACTIVE, swarm, np.arange(agents, dtype=np.int16)[None], GROUND, np.zeros(1), standard, found)
    gaps = {
        pair: np.linalg.norm(position[pair[0]] - position[pair[1]])
        for pair in combinations(np.flatnonzero(flying).tolist(), 2)
    }
    least = min(gaps, key=lambda pair: gaps[pair], default=(-1, -1))
    verdict = found.verdict[0]
    assert (verdict["agent_a"], verdict["agent_b"]) == least
    assert verdict["closest_agents_m"] == gaps.get(least, np.inf)
    for agent in range(agents):
        mine = [gap for pair, gap in gaps.items() if agent in pair]
        assert found.nearest[0, agent] == min(mine, default=np.inf)
