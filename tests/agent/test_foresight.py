"""Foresight: a drone whose commands and senses are late decides for the moment at which its command counts."""

import numpy as np
import pytest

from agent.body.foresight import Foresight
from protocols.dynamics import TICK_S, integrate
from protocols.wire.sensed import Sensed, empty_sensed

FAST, STRONG = 100.0, 100.0


def commands(ticks: int) -> list[tuple[float, float]]:
    chance = np.random.default_rng(3)
    return [tuple(row) for row in chance.uniform(-5, 5, (ticks, 2)).tolist()]


def flight(
    given: list[tuple[float, float]], late: int
) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Where a drone is, and how fast, at each tick, if the command of tick k is followed from tick k + ``late`` on."""
    state = (1.0, 2.0), (3.0, -1.0)
    path = []
    for tick in range(len(given)):
        path.append(state)
        state = integrate(*state, given[tick - late] if tick >= late else (0.0, 0.0), STRONG, FAST, TICK_S)
    return path


def seen(position: tuple[float, float], velocity: tuple[float, float]) -> Sensed:
    """A drone that senses neighbour 4, at rest at (5, 5), and an obstacle at (9, 0)."""
    sensed = empty_sensed(1)
    (x, y), (vx, vy) = position, velocity
    sensed.position[0], sensed.velocity[0] = position, velocity
    sensed.near_count[0], sensed.near[0, 0] = 1, (4, 5 - x, 5 - y, -vx, -vy)
    sensed.obstacle_count[0], sensed.obstacles[0, 0] = 1, (9 - x, -y, 1.5)
    return sensed


@pytest.mark.parametrize("late", [0, 1, 10])
def test_it_sees_itself_where_its_command_will_find_it(late: int) -> None:
    given, foresight = commands(80), Foresight()
    path = flight(given, late)
    for tick in range(80 - late):
        sensed = seen(*path[tick])
        foresight.move_on(tick, tick - 1 - late, sensed)
        foresight.remember(tick, *given[tick])
        if tick > 40:
            (x, y), (vx, vy) = path[tick + late]
            assert sensed.position[0] == pytest.approx((x, y))
            assert sensed.velocity[0] == pytest.approx((vx, vy))
            assert sensed.near[0, 0].tolist() == pytest.approx((4, 5 - x, 5 - y, -vx, -vy))
            assert sensed.obstacles[0, 0].tolist() == pytest.approx((9 - x, -y, 1.5))


def test_where_nothing_is_late_not_a_bit_is_changed() -> None:
    """So a flight in lockstep keeps its digest."""
    foresight = Foresight()
    for tick, command in enumerate(commands(60)):
        sensed, untouched = seen((0.1, 0.2), (0.3, 0.7)), seen((0.1, 0.2), (0.3, 0.7))
        foresight.move_on(tick, tick - 1, sensed)
        foresight.remember(tick, *command)
        assert all(one.tobytes() == other.tobytes() for one, other in zip(sensed, untouched, strict=True))


def test_a_neighbour_is_thought_to_fly_on_as_it_flew() -> None:
    foresight, sensed = Foresight(), seen((0.0, 0.0), (0.0, 0.0))
    sensed.near[0, 0] = (4, 2.0, 0.0, -3.0, 1.0)
    for tick in range(60):
        foresight.remember(tick, 0.0, 0.0)
        moved = Sensed(*(array.copy() for array in sensed))
        foresight.move_on(tick, tick - 11, moved)
    assert moved.near[0, 0].tolist() == pytest.approx((4, 1.7, 0.1, -3.0, 1.0))


def test_a_command_that_was_never_given_was_the_one_before() -> None:
    """A tick that did not reach the drone has no answer, and the drone flew on by the last."""
    foresight, sensed = Foresight(), seen((0.0, 0.0), (0.0, 0.0))
    foresight.remember(40, 2.0, 0.0)
    foresight.move_on(51, 40, sensed)
    assert sensed.velocity[0] == pytest.approx((2.0 * 0.1, 0.0))


def test_what_another_process_of_the_drone_commanded_says_nothing_of_delays() -> None:
    """It was restarted: until its first answer is followed it knows of no delay, and moves nothing."""
    foresight, sensed = Foresight(), seen((0.0, 0.0), (3.0, 0.0))
    for tick in range(1000, 1010):
        foresight.move_on(tick, 700, sensed)
        foresight.remember(tick, 1.0, 0.0)
    assert sensed.position[0].tolist() == [0.0, 0.0]
