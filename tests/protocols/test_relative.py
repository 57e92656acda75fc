"""Multi-hop relative positions: the paper's sum over a shortest path, and nothing beyond the last hop."""

import numpy as np
import pytest
from numpy.typing import NDArray

from agent.policy import Seen
from protocols.mission.document import Mission, parse_mission
from protocols.relative import (
    MAX_HOPS,
    NEVER,
    UNKNOWN,
    Heard,
    Nearby,
    RadioRules,
    Ways,
    Within,
    chain_displacements,
)
from rsc_swarm.flight.simulate import Simulation

Said = dict[int, tuple[int, dict[int, tuple[float, float]], dict[int, tuple[float, float]]]]


def relate(
    near: dict[int, tuple[float, float]],
    heard: Said,
    tick: int = 100,
    memory: int = 50,
    max_hops: int = 3,
    agents: int = 8,
) -> tuple[list[int], NDArray[np.float64]]:
    """Hops and positions as drone 0 has them; ``heard``: sender -> (tick, one-hop drones, two-hop drones)."""
    heard_tick, (one_hop, count) = np.full(agents, NEVER), np.zeros((2, agents), np.int64)
    known, displacement = np.zeros((agents, 64), np.uint8), np.zeros((agents, 64, 2), np.float32)
    for sender, (when, ones, twos) in heard.items():
        heard_tick[sender], one_hop[sender], count[sender] = when, len(ones), len(ones) + len(twos)
        for entry, (other, step) in enumerate([*ones.items(), *twos.items()]):
            known[sender, entry], displacement[sender, entry] = other, step
    hops, rel = np.zeros(agents, np.int64), np.zeros((agents, 2))
    near_id, near_rel = np.array([*near, -1]), np.array([*near.values(), (0.0, 0.0)])
    rules = RadioRules(range_m=6.0, memory_ticks=memory, max_hops=max_hops, speed_mps=10.0)
    said = Heard(heard_tick, one_hop, count, known, displacement)
    within = Within(np.arange(agents), np.full(MAX_HOPS + 1, agents))
    ways = Ways(hops, rel, np.zeros_like(hops), within)
    chain_displacements(0, tick, rules, Nearby(len(near), near_id, near_rel), said, ways)
    for distance in range(1, max_hops + 1):
        first, last = within.up_to[distance - 1] if distance > 1 else 0, within.up_to[distance]
        assert within.number[first:last].tolist() == np.flatnonzero(hops == distance).tolist()
    return hops.tolist(), rel


def test_a_drone_knows_itself_and_whom_it_sees() -> None:
    hops, rel = relate({2: (3.0, 4.0)}, {})
    assert hops == [0, UNKNOWN, 1] + [UNKNOWN] * 5
    assert rel[2].tolist() == [3.0, 4.0]


def test_a_neighbours_neighbours_are_added_to_the_neighbour() -> None:
    hops, rel = relate({1: (1.0, 0.0)}, {1: (99, {2: (2.0, 0.5)}, {3: (4.0, 1.0)})})
    assert hops[:4] == [0, 1, 2, 3]
    assert rel[2].tolist() == [3.0, 0.5]
    assert rel[3].tolist() == [5.0, 1.0]


def test_what_is_seen_counts_more_than_what_is_said_of_it() -> None:
    hops, rel = relate({1: (1.0, 0.0), 2: (0.0, 2.0)}, {1: (99, {2: (9.0, 9.0), 0: (7.0, 7.0)}, {})})
    assert (hops[2], rel[2].tolist()) == (1, [0.0, 2.0])
    assert (hops[0], rel[0].tolist()) == (0, [0.0, 0.0])


def test_the_shorter_path_counts_even_if_the_longer_is_fresher() -> None:
    near = {1: (1.0, 0.0), 2: (2.0, 0.0)}
    hops, rel = relate(near, {1: (99, {}, {3: (9.0, 9.0)}), 2: (80, {3: (1.0, 1.0)}, {})})
    assert (hops[3], rel[3].tolist()) == (2, [3.0, 1.0])


def test_of_two_paths_as_short_the_one_heard_last_is_taken() -> None:
    near = {1: (1.0, 0.0), 2: (2.0, 0.0)}
    for late, place in ((1, [2.0, 0.0]), (2, [4.0, 0.0])):
        heard: Said = {1: (98, {3: (1.0, 0.0)}, {}), 2: (98, {3: (2.0, 0.0)}, {})}
        heard[late] = (99, *heard[late][1:])
        assert relate(near, heard)[1][3].tolist() == place


def test_of_two_paths_as_short_and_as_fresh_the_smaller_number_is_taken() -> None:
    near = {1: (1.0, 0.0), 2: (2.0, 0.0)}
    _, rel = relate(near, {1: (99, {3: (1.0, 0.0)}, {}), 2: (99, {3: (5.0, 0.0)}, {})})
    assert rel[3].tolist() == [2.0, 0.0]


def test_a_neighbour_that_fell_silent_is_believed_for_as_long_as_memory_lasts() -> None:
    heard: Said = {1: (50, {2: (2.0, 0.0)}, {})}
    assert relate({1: (1.0, 0.0)}, heard, tick=100, memory=50)[0][2] == 2
    assert relate({1: (1.0, 0.0)}, heard, tick=101, memory=50)[0][2] == UNKNOWN


def test_nothing_is_said_of_drones_beyond_the_last_hop() -> None:
    heard: Said = {1: (99, {2: (2.0, 0.5)}, {3: (4.0, 1.0)})}
    assert relate({1: (1.0, 0.0)}, heard, max_hops=2)[0][:4] == [0, 1, 2, UNKNOWN]
    assert relate({1: (1.0, 0.0)}, heard, max_hops=1)[0][:4] == [0, 1, UNKNOWN, UNKNOWN]


class Weave:
    """Every drone swings in its own rhythm, so that no displacement stays the same for two ticks."""

    def act(self, seen: Seen) -> NDArray[np.float64]:
        x = 2.0 * np.cos(0.05 * seen.tick + 1.0 * seen.me)
        y = 0.5 * np.sin(0.03 * seen.tick + 2.0 * seen.me)
        return np.stack([x, y], axis=1)


def chain(hops: int = 3) -> Mission:
    """Five drones abreast, each in reach of the next only."""
    return parse_mission(
        {
            "agents": 5,
            "formation": {"shape": "line"},
            "start": {"radius_m": 0},
            "obstacles": {"discs": []},
            "radio": {"hops": hops},
            "safety_filter": False,
            "swap": {"rule": "off"},
        }
    )


def flown(
    mission: Mission, ticks: int
) -> tuple[Simulation, NDArray[np.float64], NDArray[np.float64], list[list[int]]]:
    """Fly a chain: per tick the true positions and drone 0's beliefs (T, 5, 2), and over how many hops."""
    simulation = Simulation([mission])
    simulation.agents.policy = Weave()
    positions, beliefs, hops = [], [], []
    for _ in range(ticks):
        positions.append(simulation.world.position[0].copy())
        simulation.tick()
        beliefs.append(simulation.agents._memory.rel[0].copy())
        hops.append(simulation.agents._memory.hops[0].tolist())
    return simulation, np.array(positions), np.array(beliefs), hops


def test_in_flight_the_third_drone_is_where_the_papers_sum_says() -> None:
    _, p, belief, hops = flown(chain(), 200)

    def step(i: int, j: int, tick: int) -> NDArray[np.float64]:
        vector: NDArray[np.float64] = p[tick, j] - p[tick, i]
        return vector

    assert np.ptp(p[:, 3] - p[:, 0], axis=0).min() > 0.03, "they must move against each other"
    for t in range(2, 200):
        assert hops[t][:4] == [0, 1, 2, 3]
        assert belief[t, 1].tolist() == step(0, 1, t).tolist()
        assert belief[t, 2].tolist() == (step(0, 1, t) + np.float32(step(1, 2, t - 1))).tolist()
        three = step(0, 1, t) + np.float32(step(1, 2, t - 1) + np.float32(step(2, 3, t - 2)))
        assert belief[t, 3].tolist() == three.tolist()
        assert belief[t, 3] == pytest.approx(step(0, 1, t) + step(1, 2, t - 1) + step(2, 3, t - 2), abs=2e-6)


def test_in_flight_the_fourth_drone_is_unknown() -> None:
    _, _, _, hops = flown(chain(), 30)
    assert all(row[4] == UNKNOWN for row in hops)


def test_with_two_hops_the_third_drone_is_unknown_too() -> None:
    _, _, _, hops = flown(chain(hops=2), 30)
    assert hops[-1] == [0, 1, 2, UNKNOWN, UNKNOWN]


def test_what_is_far_becomes_known_one_hop_a_tick() -> None:
    _, _, _, hops = flown(chain(), 4)
    assert [row[:4] for row in hops] == [
        [0, 1, UNKNOWN, UNKNOWN],
        [0, 1, 2, UNKNOWN],
        [0, 1, 2, 3],
        [0, 1, 2, 3],
    ]
