"""Nature: who moves, how far, and what the sensors see."""

from typing import Any

import numpy as np
import pytest

from protocols.mission.document import parse_mission
from world.core import Answers, WorldCore

COAST = np.zeros((3, 2))
SLOTS = np.arange(3)


def world(positions: list[list[float]], **fields: Any) -> WorldCore:
    """Three drones in a line formation, put where the test wants them, at rest."""
    core = WorldCore(
        [parse_mission({"agents": 3, "formation": {"shape": "line"}, "obstacles": {"discs": []}, **fields})]
    )
    core.position[0] = positions
    return core


def push(core: WorldCore, command: list[list[float]], ticks: int = 1) -> None:
    for _ in range(ticks):
        core.begin_tick()
        core.advance(Answers(np.array(command, float), np.zeros(3, np.int64), SLOTS))


APART = [[0.0, 0.0], [0.0, 20.0], [0.0, 40.0]]


def test_a_drone_moves_by_the_trapezoidal_rule() -> None:
    core = world(APART)
    core.velocity[0, 0] = [1.0, 0.0]
    push(core, [[2.0, -4.0], [0, 0], [0, 0]])
    assert core.velocity[0, 0].tolist() == pytest.approx([1.02, -0.04])
    assert core.position[0, 0].tolist() == pytest.approx([0.0101, -0.0002], abs=1e-15)
    assert core.position[0, 1:].tolist() == APART[1:]


def test_acceleration_and_then_speed_are_clipped_to_balls_of_ten() -> None:
    core = world(APART)
    push(core, [[300.0, 400.0], [0, 0], [0, 0]])
    assert core.velocity[0, 0].tolist() == pytest.approx([0.06, 0.08])
    push(core, [[300.0, 400.0], [0, 0], [0, 0]], ticks=200)
    assert core.velocity[0, 0].tolist() == pytest.approx([6.0, 8.0])
    # A push across bends the course and does not raise the speed.
    push(core, [[-8.0, 6.0], [0, 0], [0, 0]])
    assert np.linalg.norm(core.velocity[0, 0]) == pytest.approx(10.0)


def test_a_slow_drone_has_its_share_of_both_limits_until_it_recovers() -> None:
    slow = {"at_s": 0, "kind": "slow", "agents": [0], "factor": 0.5}
    core = world(APART, faults=[slow, {"at_s": 3, "kind": "recover", "agents": [0]}], fly_s=100)
    hard = [[100.0, 0.0], [100.0, 0.0], [0, 0]]
    push(core, hard)
    assert core.velocity[0, :2, 0].tolist() == pytest.approx([0.05, 0.1])
    push(core, hard, ticks=299)
    assert core.velocity[0, :2, 0].tolist() == pytest.approx([5.0, 10.0])
    push(core, hard, ticks=100)
    assert core.velocity[0, :2, 0].tolist() == pytest.approx([10.0, 10.0])


def test_what_has_fallen_out_of_the_air_moves_no_more_and_is_seen_by_nobody() -> None:
    core = world([[0, 0], [0, 3], [0, 6]])
    core.velocity[0, 1] = [5.0, 0.0]
    core.flying[0, [1]] = False
    push(core, [[0, 0], [9, 9], [0, 0]])
    assert core.position[0, 1].tolist() == [0.0, 3.0]
    assert seen_by(core, 0) == [2]


def seen_by(core: WorldCore, agent: int) -> list[int]:
    core.perceive()
    sensed = core.sensed
    return [int(near["number"]) for near in sensed.near[agent, : sensed.near_count[agent]]]


def test_a_drone_senses_itself_and_its_neighbours_relative_to_itself() -> None:
    core = world([[1, 2], [4, 6], [50, 50]])
    core.velocity[0, :2] = [[1.0, 0.0], [0.0, 2.0]]
    core.perceive()
    sensed = core.sensed
    assert (sensed.position[0].tolist(), sensed.velocity[0].tolist()) == ([1, 2], [1, 0])
    assert sensed.near[0, : sensed.near_count[0]].tolist() == [(1, 3, 4, -1, 2)]


@pytest.mark.parametrize(("gap", "seen"), [(6.0, [1]), (np.nextafter(6.0, 7), [])])
def test_sensing_ends_at_exactly_six_metres(gap: float, seen: list[int]) -> None:
    assert seen_by(world([[0, 0], [gap, 0], [99, 0]]), 0) == seen


def test_obstacles_are_seen_by_their_surface() -> None:
    core = world(APART, obstacles={"discs": [[8, 0, 2.0], [0, -7.99, 2.0], [-8, 0, 2.1]]})
    core.position[0] = APART
    core.perceive()
    sensed = core.sensed
    assert sensed.obstacles[0, : sensed.obstacle_count[0]].tolist() == [(0, -7.99, 2.0), (-8, 0, 2.1)]
    assert sensed.obstacle_count[1] == 0


def test_where_neighbours_are_only_heard_none_is_sensed() -> None:
    assert seen_by(world([[0, 0], [0, 3], [0, 6]], sensing={"neighbours": "heard"}), 0) == []
