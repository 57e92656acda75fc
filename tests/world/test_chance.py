"""Chance: every draw belongs to its five integers and to nothing else."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols.kernels import kernel
from world.medium import chance


@kernel
def _draws(seed: int, rule: int, source: int, destination: int, ticks: int, out: np.ndarray) -> None:
    for tick in range(ticks):
        out[tick] = chance.uniform(seed, rule, source, destination, tick)


def draws(
    seed: int = 1, rule: int = chance.LOSS, source: int = 2, destination: int = 3, ticks: int = 20_000
) -> np.ndarray:
    out = np.empty(ticks)
    _draws(seed, rule, source, destination, ticks, out)
    return out


ANY_DRAW = {
    "seed": st.integers(0, 2**32 - 1),
    "rule": st.integers(1, 5),
    "source": st.integers(0, 249),
    "destination": st.integers(0, 249),
    "tick": st.integers(0, 360_000),
}


@given(**ANY_DRAW)
def test_a_draw_is_at_least_zero_and_below_one_and_the_same_when_asked_again(
    seed: int, rule: int, source: int, destination: int, tick: int
) -> None:
    draw = chance.uniform(seed, rule, source, destination, tick)
    assert 0.0 <= draw < 1.0
    assert chance.uniform(seed, rule, source, destination, tick) == draw


def test_the_mixing_is_splitmix64s() -> None:
    """The first outputs for the state 1234567, as published with its reference implementation."""
    known = [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
        4593380528125082431,
        16408922859458223821,
    ]
    states = [(1234567 + step * 0x9E3779B97F4A7C15) % 2**64 for step in range(1, 6)]
    assert [int(chance._mixed(np.uint64(state))) for state in states] == known


def in_whole_numbers(seed: int, rule: int, source: int, destination: int, tick: int) -> float:
    """The generator once more, in Python's own unbounded integers."""
    end, gamma = 1 << 64, 0x9E3779B97F4A7C15

    def mixed(state: int) -> int:
        state = (state ^ state >> 30) * 0xBF58476D1CE4E5B9 % end
        state = (state ^ state >> 27) * 0x94D049BB133111EB % end
        return state ^ state >> 31

    link = rule << 32 | source << 16 | destination
    state = mixed((seed + 1) * gamma % end)
    state = mixed(state ^ link * gamma % end)
    return (mixed((state + tick * gamma) % end) >> 11) / 2**53


@given(**ANY_DRAW)
def test_the_luck_of_a_seed_is_the_same_on_every_machine(
    seed: int, rule: int, source: int, destination: int, tick: int
) -> None:
    draw = chance.uniform(seed, rule, source, destination, tick)
    assert draw == in_whole_numbers(seed, rule, source, destination, tick)


def test_draws_spread_evenly() -> None:
    share, _ = np.histogram(draws(), bins=10, range=(0, 1))
    # Ten bins of 2000 +- 42: five standard deviations.
    assert abs(share - 2000).max() < 5 * 42.4


@pytest.mark.parametrize(
    "other",
    [
        {"seed": 2},
        {"rule": chance.JITTER},
        {"source": 3},
        {"destination": 2},
        {"source": 3, "destination": 2},
    ],
)
def test_another_seed_rule_or_link_has_luck_of_its_own(other: dict[str, int]) -> None:
    assert abs(np.corrcoef(draws(), draws(**other))[0, 1]) < 0.04


def test_one_tick_says_nothing_about_the_next() -> None:
    numbers = draws()
    assert abs(np.corrcoef(numbers[:-1], numbers[1:])[0, 1]) < 0.04
