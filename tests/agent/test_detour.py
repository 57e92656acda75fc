"""The way out of a pocket: which way is the shortest, and a drone that takes it."""

import math

import numpy as np
import pytest

from agent.control.detour import STALLED_TICKS, leave_pocket, next_corner
from agent.memory import Memory, empty_memory
from protocols.mission.document import Mission, parse_mission
from rsc_swarm.flight.simulate import simulate
from tests.parts import empty_parts

CUP = [
    (3.0, 3.0, 1.5),
    (5.0, 1.2, 1.5),
    (5.0, -1.2, 1.5),
    (3.0, -3.0, 1.5),
    (1.0, 3.6, 1.0),
]  # open to the left


def way(
    goal: tuple[float, float], *discs: tuple[float, float, float], exits: bool = False
) -> tuple[int, float, float]:
    """The next corner of the way from (0, 0), 0.62 m from all surfaces."""
    table = np.array(discs, float).reshape(-1, 3)
    return next_corner(*goal, len(table), table[:, :2].copy(), table[:, 2].copy(), 0.62, exits)


def stopped(*discs: tuple[float, float, float]) -> Memory:
    """What a drone at (0, 0) knows that has just been stopped by these."""
    memory = empty_memory(1, 3)
    memory.disc_count[0] = len(discs)
    for index, (x, y, radius) in enumerate(discs):
        memory.obstacle_rel[0, index] = x, y
        memory.obstacle_radius[0, index] = radius
    memory.stalled[0] = STALLED_TICKS
    return memory


def led(
    memory: Memory, slot: tuple[float, float], wanted: tuple[float, float] = (0.0, 0.0), target_mps: float = 0.0,
    speed: tuple[float, float] = (0.0, 0.0),
) -> tuple[float, float]:  # fmt: skip
    """What becomes of the acceleration ``wanted`` by a drone at (0, 0) whose slot is at ``slot``."""
    parts = empty_parts(Mission(agents=3), memory=memory)
    work, sensed = parts.work, parts.sensed
    work.slot_error[0], work.target_velocity[0, 0] = slot, target_mps
    sensed.velocity[0] = speed
    return leave_pocket(wanted, 0, parts.rules, work, sensed, memory)


def out_of_the_cup() -> Memory:
    """What a drone at (0, 0) knows that was led out of the cup; nothing is in its way any more."""
    memory = stopped(*CUP)
    led(memory, (12.0, 0.0))
    memory.disc_count[0] = 0
    return memory


def test_where_nothing_is_in_the_way_the_goal_is_next() -> None:
    assert way((9.0, 1.0)) == (0, 9.0, 1.0)
    assert way((9.0, 1.0), (4.0, -4.0, 1.5)) == (0, 9.0, 1.0)


def test_a_disc_is_passed_on_its_shorter_side_with_room_to_its_surface() -> None:
    corners, x, y = way((10.0, 0.0), (5.0, 0.5, 1.5))
    assert corners >= 1
    assert y < 0.0
    assert 0.6 < math.hypot(x - 5.0, y - 0.5) - 1.5 < 0.8


def test_the_way_out_of_a_cup_leads_back_first() -> None:
    corners, x, y = way((12.0, 0.0), *CUP)
    assert corners >= 2
    assert (x, y) == pytest.approx((3.0, -3.0), abs=2.5), "around the lower lip, as the upper one is longer"
    assert y < -0.5


def test_a_gap_too_narrow_is_no_way_and_one_wide_enough_is() -> None:
    assert way((10.0, 0.0), (5.0, 1.6, 1.0), (5.0, -1.6, 1.0))[0] > 0, "a gap of 1.2 m"
    assert way((10.0, 0.0), (5.0, 1.65, 1.0), (5.0, -1.65, 1.0))[0] == 0, "a gap of 1.3 m"


def test_there_is_no_way_out_of_a_ring() -> None:
    ring = [(4.0 * math.cos(k * math.pi / 6), 4.0 * math.sin(k * math.pi / 6), 1.0) for k in range(12)]
    assert way((12.0, 0.0), *ring)[0] == -1


@pytest.mark.parametrize("gap", [1.17, 1.19, 1.21, 1.23])
@pytest.mark.parametrize("before", [0.01, 0.1, 0.2, 0.4])
@pytest.mark.parametrize("radii", [(1.8, 1.91), (1.65, 1.96), (1.0, 2.0), (1.0, 1.0)])
def test_who_is_stopped_in_a_gap_too_narrow_finds_the_way_back_out(
    gap: float, before: float, radii: tuple[float, float]
) -> None:
    upper, lower = radii
    neck = [(before, upper + gap / 2, upper), (before, -lower - gap / 2, lower)]
    corners, x, y = way((12.0, 0.0), *neck, exits=True)
    assert corners >= 1
    assert x < 0.0, "back, as ahead one would come too near to both"
    there = [(cx - x, cy - y, radius) for cx, cy, radius in neck]
    assert way((12.0 - x, -y), *there)[0] >= 1, "and from there around"


def test_out_of_a_ring_there_are_no_exits_either() -> None:
    ring = [(1.65 * math.cos(k * math.pi / 3), 1.65 * math.sin(k * math.pi / 3), 1.0) for k in range(6)]
    assert way((12.0, 0.0), *ring, exits=True)[0] == -1


def test_a_slot_inside_an_obstacle_can_be_flown_to_as_far_as_that_goes() -> None:
    assert way((5.0, 0.0), (5.0, 0.5, 1.5))[0] == 0


def test_a_narrow_gap_is_flown_only_where_there_is_no_wider_one() -> None:
    wall = [(5.0, 1.65, 1.0), (5.0, -1.65, 1.0), (5.0, -3.5, 1.0), (5.0, -5.5, 1.0)]  # a gap of 1.3 m ahead
    _, aside = led(stopped(*wall), (10.0, 0.0))
    assert aside > 1.0, "around the end of the wall"
    angles = np.linspace(0.39, 2 * math.pi - 0.39, 12)
    ring = [
        (4.33 * math.cos(angle), 4.33 * math.sin(angle), 1.0) for angle in angles
    ]  # the same gap, and no other
    ahead, _ = led(stopped(*ring), (10.0, 4.0))
    assert ahead > 1.0, "through the gap"


@pytest.mark.parametrize("before", [0.01, 0.05, 0.2])
def test_who_stands_in_a_gap_too_narrow_flies_back(before: float) -> None:
    neck = [(before, 1.8 + 0.595, 1.8), (before, -1.9 - 0.595, 1.9)]
    ahead, aside = led(stopped(*neck), (12.0, 0.0))
    assert ahead < -1.0
    assert abs(aside) < -ahead


def test_only_who_gets_no_nearer_for_a_while_leaves_its_own_plan() -> None:
    memory = stopped(*CUP)
    memory.stalled[0] = 0
    for _ in range(STALLED_TICKS):
        assert led(memory, (12.0, 0.0), (1.0, 2.0)) == (1.0, 2.0)
    assert led(memory, (12.0, 0.0), (1.0, 2.0)) != (1.0, 2.0)
    memory.stalled[0] = 0
    for _ in range(3 * STALLED_TICKS):
        assert led(memory, (12.0, 0.0), (1.0, 2.0), speed=(3.0, 0.0)) == (1.0, 2.0)


def test_who_is_stopped_by_nothing_keeps_its_own_plan() -> None:
    memory = stopped()
    for _ in range(3 * STALLED_TICKS):
        assert led(memory, (12.0, 0.0), (1.0, 2.0)) == (1.0, 2.0)


def test_a_detour_ends_where_the_slot_is_caught_up_with() -> None:
    memory = out_of_the_cup()
    for _ in range(20):
        _, up = led(memory, (0.0, 12.0))
    assert up > 10.0, "straight to the slot, wherever that is by now"
    assert led(memory, (0.0, 3.0), (1.0, 2.0)) == (1.0, 2.0)
    assert memory.stalled[0] == 0


def test_the_way_home_is_flown_faster_than_the_slot_moves() -> None:
    memory = out_of_the_cup()
    for _ in range(20):
        _, up = led(memory, (0.0, 12.0), target_mps=9.0, speed=(0.0, 9.0))
    assert up > 1.0


@pytest.mark.parametrize("gap", [1.15, 1.17, 1.19, 1.21])
def test_a_drone_that_flew_into_a_gap_too_narrow_comes_out_of_it(gap: float) -> None:
    discs = [[12.0, 1.8 + gap / 2, 1.8], [12.1, -1.9 - gap / 2, 1.9]]
    fields = {"agents": 1, "policy": "cruise", "start": {"radius_m": 0}, "obstacles": {"discs": discs}}
    assert simulate([parse_mission(fields)])[0].failure is None


@pytest.mark.parametrize("detour", [True, False])
def test_a_drone_that_flew_into_a_cup_comes_out_only_by_a_detour(detour: bool) -> None:
    # The policy flies straight to its slot.
    discs = [[12.0 + x, y, radius] for x, y, radius in CUP]
    fields = {"agents": 1, "policy": "cruise", "start": {"radius_m": 0}, "obstacles": {"discs": discs}}
    result = simulate([parse_mission({**fields, "detour": detour})])[0]
    assert (result.failure is None) == detour
