"""Plans are flown as they were made: tracked tick by tick, and left to the reactive controller near other things."""

import numpy as np
import pytest

from agent.control.apf import APF, safety_controller
from agent.control.attraction import Aim
from agent.control.follow import Following, Plan, follow_row, following_of, track_row
from agent.control.gains import GAINS, gains_for, reactive_part
from agent.control.surroundings import Discs, Neighbours
from agent.policy.analytic_kernel import analytic
from protocols.dynamics import TICK_S, integrate
from protocols.mission.document import Mission, parse_mission
from protocols.mission.fields import Trajectory

START = np.array([2.0, -1.0, 3.0, 0.5])


def curve(ticks: int) -> tuple[np.ndarray, np.ndarray]:
    """A plan that turns: its displacements from flying straight on, and its accelerations."""
    acceleration = np.array([[np.cos(0.1 * h), np.sin(0.1 * h)] for h in range(ticks)], np.float32)
    displacement = np.zeros((ticks, 2))
    place, speed = np.zeros(2), np.zeros(2)
    for h, a in enumerate(acceleration.astype(float)):
        place, speed = place + TICK_S * (speed + 0.5 * a * TICK_S), speed + a * TICK_S
        displacement[h] = place
    return displacement.astype(np.float32), acceleration


def planned(displacement: np.ndarray, h: int) -> np.ndarray:
    """Where the plan is after tick h."""
    return START[:2] + START[2:] * (h + 1) * TICK_S + displacement[h]


@pytest.mark.parametrize("required", [False, True])
def test_a_drone_on_its_plan_stays_on_it(required: bool) -> None:
    displacement, acceleration = curve(20)
    place, speed = tuple(START[:2]), tuple(START[2:])
    for h in range(20):
        a = track_row(h, Plan(START, displacement, acceleration), place, speed, required)
        if not required:
            assert a == pytest.approx(acceleration[h], abs=1e-4)
        place, speed = integrate(place, speed, a, 10.0, 10.0, TICK_S)
        assert place == pytest.approx(planned(displacement, h), abs=1e-6)


def test_a_drone_that_was_pushed_off_its_plan_comes_back_smoothly() -> None:
    displacement, acceleration = curve(200)
    place, speed = (START[0], START[1] + 0.1), tuple(START[2:])
    for h in range(200):
        a = track_row(h, Plan(START, displacement, acceleration), place, speed, False)
        assert np.hypot(*a) < 4.0
        place, speed = integrate(place, speed, a, 10.0, 10.0, TICK_S)
    assert place == pytest.approx(planned(displacement, 199), abs=1e-3)


def test_the_papers_form_is_at_the_next_point_one_tick_later() -> None:
    displacement, acceleration = curve(20)
    off, speed = (START[0], START[1] + 0.001), tuple(START[2:])
    a = track_row(0, Plan(START, displacement, acceleration), off, speed, True)
    place, _ = integrate(off, speed, a, 1e9, 1e9, TICK_S)
    assert place == pytest.approx(planned(displacement, 0), abs=1e-9)


def follow(
    following: Following, neighbours: list[tuple[float, float]], discs: list[tuple[float, float, float]]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """What a drone that plans to fly straight on does amid these, and what the reactive controller alone would do."""
    still = np.zeros((5, 2), np.float32)
    rel, vel = np.array(neighbours).reshape(-1, 2), np.zeros((len(neighbours), 2))
    table = np.array(discs, float).reshape(-1, 3)
    o_rel, o_radius, o_side = table[:, :2].copy(), table[:, 2].copy(), np.zeros(len(discs), np.int8)
    aim = Aim((7.0, 7.0), (1.0, 0.5), tuple(START[2:]), (3.0, 0.0))  # the chain's error does not count
    near = Neighbours(len(rel), rel, vel)
    known = Discs(len(table), o_rel, o_radius, o_side)
    wanted = follow_row(0, Plan(START, still, still), tuple(START[:2]), aim, near, known, following)
    o_side[:] = 0
    reactive = analytic(aim._replace(chain_error=aim.slot_error), near, known, following.reactive)
    return wanted, reactive


def test_the_nearer_the_next_thing_the_more_the_reactive_controller_counts() -> None:
    blend = following_of(Mission(trajectory=Trajectory(blend_radius_m=1.5)))
    assert follow(blend, [(0.0, 3.0)], [(4.0, 0.0, 2.0)])[0] == (0.0, 0.0)
    wanted, reactive = follow(blend, [(0.0, 0.75)], [])
    assert wanted == pytest.approx(tuple(0.5 * a for a in reactive))
    wanted, reactive = follow(blend, [(0.0, 3.0)], [(2.5, 0.0, 2.0)])
    assert wanted == pytest.approx(tuple(2 / 3 * a for a in reactive))


def test_the_papers_safety_controller_may_be_blended_in() -> None:
    """It looks at obstacles and the goal alone, so a drone nearby only makes it count more."""
    papers = following_of(Mission(trajectory=Trajectory(blend_radius_m=1.5, blend_with="paper")))
    disc = Discs(1, np.array([[4.0, 0.0]]), np.array([2.0]), np.zeros(1, np.int8))
    aim = Aim((0.0, 0.0), (1.0, 0.5), tuple(START[2:]), (3.0, 0.0))
    wanted, _ = follow(papers, [(0.0, 0.75)], [(4.0, 0.0, 2.0)])
    assert wanted == pytest.approx(tuple(0.5 * a for a in safety_controller(aim, disc, papers.apf)))


def test_without_the_blend_only_the_plan_counts() -> None:
    alone = following_of(Mission(trajectory=Trajectory(blend=False)))
    assert follow(alone, [(0.0, 0.6)], [(2.5, 0.0, 2.0)])[0] == (0.0, 0.0)


def test_a_mission_says_how_plans_are_flown() -> None:
    mission = parse_mission({"trajectory": {"tracking": "required", "blend_radius_m": 2.0}})
    reactive = reactive_part(GAINS)
    assert following_of(mission) == Following(True, 2.0, reactive, papers=False, apf=APF)
    wide = following_of(parse_mission({"limits": {"collision_m": 0.9}}))
    assert wide.reactive == reactive_part(gains_for(0.9))
