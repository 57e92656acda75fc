"""Clocks: lockstep is as fast as the machine, realtime keeps a hundred ticks to the second."""

from tests.scenarios.flights import Fields, launched

SIX: Fields = {"agents": 6, "map_seed": 3}


def test_in_real_time_six_drones_hold_a_hundred_ticks_a_second_and_succeed() -> None:
    (flight,) = launched(SIX, clock="realtime")
    outcome = flight["outcome"]
    assert outcome["success"], outcome
    assert (
        0.99 < flight["wall_s"] / (outcome["ticks"] * 0.01) < 1.5
    )  # what a busy machine holds up is made good


def test_lockstep_misses_nothing_and_every_drone_tells_of_itself() -> None:
    (flight,) = launched({**SIX, "fly_s": 1.0})
    assert flight["command_ages"] is None
    assert flight["outcome"]["lost_agents"] == []
    assert flight["told"] == list(range(6))
    assert flight["tally"]["sent"] == 600
