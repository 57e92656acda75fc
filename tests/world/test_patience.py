"""Patience in lockstep: one drone may keep the others waiting for a while, and not for ever."""

import pytest

from world.server.patience import GRACE_S, PATIENCE_S, WATCHED_S, Patience

ALL, LAST = {0, 1, 2}, {2}


def fly_until_lost(late_s: float, tick_s: float, most: int = 3000) -> tuple[int, float]:
    """Ticks in which drones 0 and 1 answer after ``tick_s`` and drone 2 ``late_s`` later: how many until it is lost, and when."""
    patience, now = Patience(3), 0.0
    for tick in range(most):
        patience.begin(ALL, True, now)
        now += tick_s
        patience.left(LAST, now)
        if patience.over(2, now + late_s, now + late_s):
            return tick, now + late_s
        now += late_s
        patience.left(set(), now)
    return most, now


def test_whoever_is_late_by_a_second_each_time_is_lost_after_the_grace() -> None:
    ticks, when = fly_until_lost(1.0, 0.01)
    assert ticks == 5
    assert when == pytest.approx(GRACE_S + 1.0, abs=0.1)


@pytest.mark.parametrize("late_s", [0.011, 0.02, 0.1, 0.5])
def test_however_it_spreads_its_lateness_a_flight_takes_no_more_than_twice_its_time_and_the_grace(
    late_s: float,
) -> None:
    ticks, when = fly_until_lost(late_s, 0.01)
    assert when <= 2 * 0.01 * (ticks + 1) + GRACE_S + late_s


def test_whoever_is_a_little_slower_than_the_others_is_never_lost() -> None:
    assert fly_until_lost(0.0099, 0.01)[0] == 3000


def test_one_long_pause_costs_a_second_at_most() -> None:
    patience = Patience(3)
    patience.begin(ALL, True, 0.0)
    patience.left(LAST, 0.01)
    assert patience.over(2, 80.0, 80.0) is None
    patience.left(set(), 80.0)
    patience.begin(ALL, True, 80.0)
    patience.left(LAST, 80.01)
    assert patience.over(2, 80.02, 80.02) is None


def test_total_silence_has_an_end() -> None:
    patience = Patience(3)
    patience.begin(ALL, True, 10.0)
    assert patience.over(1, 10.0 + PATIENCE_S, 1e6) is None
    assert patience.over(1, 10.1 + PATIENCE_S, 1e6) == "it has not answered for 90 s"


def test_many_drones_of_one_machine_are_each_given_their_turn() -> None:
    few, many = Patience(25, watched=True), Patience(250, watched=True)
    for patience in (few, many):
        patience.begin(ALL, True, 0.0)
    assert few.over(1, WATCHED_S + 0.1, 1e6) == "it has not answered for 20 s"
    assert many.over(1, WATCHED_S + 0.1, 1e6) is None
    assert many.over(1, 50.1, 1e6) == "it has not answered for 50 s"


def test_a_process_known_to_be_stopped_is_waited_for_and_owes_nothing() -> None:
    patience = Patience(3)
    patience.begin(ALL, True, 0.0)
    patience.left(LAST, 0.01)
    for second in range(1, 1000):
        patience.pause(2, float(second))
        assert patience.over(2, second + 0.2, second + 0.2) is None


def test_a_drone_that_flies_alone_keeps_nobody_waiting() -> None:
    patience = Patience(1)
    for tick in range(100):
        patience.begin({0}, False, float(tick))
        assert patience.over(0, tick + 0.99, tick + 0.99) is None
        patience.left(set(), tick + 0.99)
