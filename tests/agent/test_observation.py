"""The observation X_i: 18 numbers, all relative, and the two kinds of target."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from agent.observation import aim_row, observe_row
from protocols.mission.document import parse_mission
from protocols.relative import UNKNOWN
from tests.parts import empty_parts

REACH = 6.0
Vector = tuple[float, float]


def observe(
    error: Vector = (0.0, 0.0),
    velocity: Vector = (0.0, 0.0),
    target_velocity: Vector = (0.0, 0.0),
    obstacles: list[tuple[float, float, float]] | None = None,
    neighbours: list[tuple[float, float, float, float]] | None = None,
) -> NDArray[np.float64]:
    """X of one drone. Obstacles: relative centre and radius. Neighbours: relative position and velocity."""
    parts = empty_parts(parse_mission({"agents": 4}))
    work, sensed, memory = parts.work, parts.sensed, parts.memory
    work.slot_error[0], work.target_velocity[0] = error, target_velocity
    sensed.position[0], sensed.velocity[0] = (7.0, -3.0), velocity
    for index, (x, y, radius) in enumerate(obstacles or []):
        memory.obstacle_rel[0, index], memory.obstacle_radius[0, index] = (x, y), radius
        memory.disc_count[0] = index + 1
    for index, (x, y, vx, vy) in enumerate(neighbours or []):
        memory.near_rel[0, index], memory.near_vel[0, index] = (x, y), (vx, vy)
        memory.near_count[0] = index + 1
    observation = np.full((1, 18), 99.0)
    observe_row(0, REACH, work, sensed, memory, observation[0])
    return observation[0]


def test_a_drone_in_its_place_that_sees_nothing_observes_zeros() -> None:
    assert observe(velocity=(3, 0), target_velocity=(3, 0)).tolist() == [0.0] * 18


def test_a_large_error_is_compressed() -> None:
    x = observe(error=(3.0, 4.0))
    assert x[:2].tolist() == pytest.approx([3 / 3.5, 4 / 3.5])
    assert np.linalg.norm(observe(error=(1e6, 0.0))[:2]) == pytest.approx(2.0, abs=1e-5)


def test_velocity_counts_relative_to_the_target() -> None:
    assert observe(velocity=(1.0, 2.0), target_velocity=(3.0, 0.0))[2:4].tolist() == [-1.0, 1.0]


def test_an_obstacle_is_seen_from_its_surface_and_grows_as_it_nears() -> None:
    # Surface 3 m away: s = 1/2. The normal points from the obstacle to the drone.
    x = observe(obstacles=[(0.0, 4.0, 1.0)])
    assert x[4:7].tolist() == pytest.approx([0.0, -0.5, 0.5])
    assert x[7:].tolist() == [0.0] * 11
    touching = observe(obstacles=[(0.0, 1.0, 1.0)])
    assert touching[4:7].tolist() == pytest.approx([0.0, -1.0, 1.0])


def test_the_two_nearest_obstacles_come_in_order_of_their_surfaces() -> None:
    x = observe(obstacles=[(5.0, 0.0, 1.0), (0.0, 5.5, 2.5), (-3.5, 0.0, 1.5)])
    # Surfaces at 4, 3 and 2 m.
    assert x[4:7].tolist() == pytest.approx([4 / 6, 0.0, 1.5 * 4 / 6])
    assert x[7:10].tolist() == pytest.approx([0.0, -0.5, 2.5 * 0.5])


def test_the_two_nearest_neighbours_come_with_their_relative_velocity() -> None:
    x = observe(neighbours=[(5.0, 0.0, 9.0, 9.0), (0.0, -3.0, 2.0, 4.0), (1.5, 0.0, -2.0, 0.0)])
    assert x[10:14].tolist() == pytest.approx([-0.75, 0.0, -0.75, 0.0])
    assert x[14:18].tolist() == pytest.approx([0.0, 0.5, 0.5, 1.0])


@pytest.mark.parametrize("gap", [6.0, 7.5])
def test_what_comes_into_sight_starts_at_zero(gap: float) -> None:
    assert (
        observe(obstacles=[(gap + 1.0, 0.0, 1.0)], neighbours=[(gap, 0.0, 5.0, 5.0)]).tolist() == [0.0] * 18
    )
    near = observe(obstacles=[(6.999, 0.0, 1.0)], neighbours=[(5.999, 0.0, 5.0, 5.0)])
    assert 0 < abs(near[4:]).max() < 1e-3


METRE = st.floats(-20, 20)


@given(
    rel=st.lists(st.tuples(METRE, METRE, st.floats(-10, 10), st.floats(-10, 10)), max_size=5),
    discs=st.lists(st.tuples(METRE, METRE, st.floats(1, 2)), max_size=5),
    error=st.tuples(METRE, METRE),
    velocity=st.tuples(st.floats(-7, 7), st.floats(-7, 7)),
)
def test_all_numbers_stay_within_what_a_frame_can_carry(
    rel: Any, discs: Any, error: Vector, velocity: Vector
) -> None:
    x = observe(error, velocity, (5.0, 0.0), discs, rel)
    assert np.isfinite(x).all()
    assert np.abs(x).max() < 16.0
    assert np.linalg.norm(x[4:6]) <= 1.0 + 1e-9
    assert np.linalg.norm(x[10:12]) <= 1.0 + 1e-9


@given(
    turn=st.floats(0, 2 * math.pi), error=st.tuples(METRE, METRE), other=st.tuples(METRE, METRE, METRE, METRE)
)
def test_a_turned_world_is_observed_turned(
    turn: float, error: Vector, other: tuple[float, float, float, float]
) -> None:
    def turned(x: float, y: float) -> Vector:
        return math.cos(turn) * x - math.sin(turn) * y, math.sin(turn) * x + math.cos(turn) * y

    x = observe(error, neighbours=[other])
    after = observe(turned(*error), neighbours=[(*turned(*other[:2]), *turned(*other[2:]))])
    if abs(math.hypot(*other[:2]) - REACH) > 1e-6 and math.hypot(*other[:2]) > 1e-6:
        for place in (0, 10, 12):
            assert after[place : place + 2] == pytest.approx(turned(*x[place : place + 2]), abs=1e-9)


MISSION = parse_mission({"agents": 4, "formation": {"shape": "line"}})
LAYOUT = MISSION.layout  # root 1; 0 and 2 follow it, 3 follows 2


def aim(
    chain: bool, hops_to_leader: int = 1, me: int = 3, slots: tuple[int, ...] = (0, 1, 2, 3)
) -> tuple[list[float], list[float]]:
    """(chain error, slot error) of drone ``me`` at (1, 2); its leader is 1 m ahead and 4 m to the right."""
    parts = empty_parts(MISSION, me)
    work, views, memory = parts.work, parts.views, parts.memory
    parts.sensed.position[0] = [1.0, 2.0]
    work.target_position[0] = [10.0, 0.0]
    views.slot_of[0], views.occupant[0] = slots, np.argsort(slots)
    memory.hops[0] = UNKNOWN
    above = LAYOUT.parent[slots[me]]
    if above >= 0:
        memory.hops[0, views.occupant[0, above]] = hops_to_leader
        memory.rel[0, views.occupant[0, above]] = [1.0, -4.0]
    aim_row(0, chain, parts.shape, views, work, parts.sensed, memory)
    return work.chain_error[0].tolist(), work.slot_error[0].tolist()


def test_the_slot_target_is_the_virtual_target_plus_the_slots_offset() -> None:
    assert LAYOUT.root == 1
    assert aim(chain=False) == ([9.0, 8.0], [9.0, 8.0])


@pytest.mark.parametrize("hops", [1, 2, 3])
def test_the_chain_target_is_the_leader_plus_the_difference_of_the_slots(hops: int) -> None:
    assert aim(chain=True, hops_to_leader=hops) == ([1.0, 1.0], [9.0, 8.0])


def test_a_leader_out_of_reach_falls_back_to_the_slot_target() -> None:
    assert aim(chain=True, hops_to_leader=UNKNOWN) == ([9.0, 8.0], [9.0, 8.0])


def test_the_root_always_aims_at_the_virtual_target() -> None:
    assert aim(chain=True, me=1) == ([9.0, -2.0], [9.0, -2.0])


def test_the_leader_is_whoever_holds_the_slot_above() -> None:
    # Drones 0 and 2 have swapped: drone 3's leader is drone 0 now, and drone 0 flies in slot 2.
    assert aim(chain=True, slots=(2, 1, 0, 3)) == ([1.0, 1.0], [9.0, 8.0])
    assert aim(chain=False, me=0, slots=(2, 1, 0, 3))[1] == [9.0, 3.0]
