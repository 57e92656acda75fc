"""Functions of our own in place of the C library's: right to the last place or so, and the same bits compiled or not."""

import math
from collections.abc import Callable, Iterable
from decimal import Decimal, localcontext
from typing import Any

import numpy as np
import pytest

from protocols import arithmetic
from protocols.kernels import COMPILED

DRAW = np.random.default_rng(1)
ANGLES = [*DRAW.uniform(-10.0, 10.0, 3000).tolist(), *(k * math.pi / 8 for k in range(-32, 33))]


def interpreted(rule: Any) -> Callable[..., float]:
    """The rule as the Python that it is written in."""
    python: Callable[..., float] = rule.py_func if COMPILED else rule
    return python


def worst_of_exp(values: Iterable[float]) -> float:
    """The largest error of `exp`, in units in the last place of what is true."""
    with localcontext(prec=40):
        true = [(x, Decimal(x).exp()) for x in values]
        return max(float(abs(Decimal(arithmetic.exp(x)) - y) / Decimal(math.ulp(float(y)))) for x, y in true)


def test_exp_is_right_to_one_unit_in_the_last_place() -> None:
    everywhere, near = DRAW.uniform(-708.0, 709.7, 2000), DRAW.uniform(-2.0, 2.0, 5000)
    half_steps = [(k + 0.5) * math.log(2) for k in range(-1000, 1000, 7)]  # where |r| is largest
    assert worst_of_exp([*everywhere.tolist(), *near.tolist(), *half_steps]) < 1.0


def test_exp_of_what_is_hardly_a_number_is_right_too() -> None:
    assert worst_of_exp(DRAW.uniform(-745.1, -708.0, 500).tolist()) <= 1.0


def test_exp_at_its_ends() -> None:
    assert arithmetic.exp(0.0) == arithmetic.exp(-0.0) == arithmetic.exp(5e-324) == 1.0
    assert arithmetic.exp(-math.inf) == arithmetic.exp(-1e300) == arithmetic.exp(-745.14) == 0.0
    assert arithmetic.exp(math.inf) == arithmetic.exp(1e300) == arithmetic.exp(709.79) == math.inf
    assert arithmetic.exp(-745.13) == math.exp(-745.13) == 5e-324
    assert math.isfinite(arithmetic.exp(709.782712893384))
    assert math.isnan(arithmetic.exp(math.nan))


def test_sine_and_cosine_are_right_to_some_1e_16() -> None:
    for x in ANGLES:  # the C library's are wrong by 6e-17 or so
        assert abs(arithmetic.sine(x) - math.sin(x)) < 2e-16
        assert abs(arithmetic.cosine(x) - math.cos(x)) < 2e-16


def test_sine_and_cosine_of_large_angles_are_as_right_and_beyond_there_are_none() -> None:
    for x in DRAW.uniform(-1e6, 1e6, 3000).tolist():
        assert abs(arithmetic.sine(x) - math.sin(x)) < 2e-16
        assert abs(arithmetic.cosine(x) - math.cos(x)) < 2e-16
    assert all(math.isnan(arithmetic.sine(x)) for x in (1.1e6, -1.1e6, math.inf, -math.inf, math.nan))


def test_length_is_that_of_a_vector() -> None:
    assert arithmetic.length(3.0, -4.0) == 5.0
    assert arithmetic.length(0.0, 0.0) == 0.0
    for x, y in DRAW.uniform(-100.0, 100.0, (500, 2)).tolist():
        assert arithmetic.length(x, y) == pytest.approx(math.hypot(x, y), rel=3e-16)


def values_of(name: str) -> list[list[float]]:
    """Arguments for a function: many usual ones, and those at its ends."""
    if name == "length":
        return DRAW.normal(0.0, 20.0, (500, 2)).tolist()  # type: ignore[no-any-return]
    ends = [0.0, math.inf, -math.inf, 1e300, -1e300]
    usual = [*DRAW.uniform(-750.0, 715.0, 500).tolist(), *DRAW.normal(size=500).tolist()]
    return [[x] for x in (*usual, *ends)]


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
@pytest.mark.parametrize("name", ["exp", "sine", "cosine", "length"])
def test_compiled_and_not_a_function_gives_the_same_bits(name: str) -> None:
    rule = getattr(arithmetic, name)
    python, values = interpreted(rule), values_of(name)
    assert [rule(*given).hex() for given in values] == [python(*given).hex() for given in values]


WRITTEN = {
    "exp": {
        1.0: "0x1.5bf0a8b14576ap+1", -0.1: "0x1.cf46d99d52b3ap-1", -3.7: "0x1.9511fc6871044p-6",
        12.25: "0x1.982aa4f9aec90p+17", -700.3: "0x1.9a5615b10648ap-1011", -740.0: "0x0.0000000000055p-1022",
    },
    "sine": {0.5: "0x1.eaee8744b05f0p-2", -2.0: "-0x1.d18f6ead1b446p-1", 100.0: "-0x1.03425b78c4db8p-1"},
    "cosine": {0.5: "0x1.c1528065b7d50p-1", -2.0: "-0x1.aa22657537205p-2", 100.0: "0x1.b981dbf665fe0p-1"},
}  # fmt: skip


@pytest.mark.parametrize("name", WRITTEN)
def test_a_function_gives_the_bits_that_are_written_here(name: str) -> None:
    """Another compiler or processor that gives others is found here, before flights are compared."""
    rule = getattr(arithmetic, name)
    assert {x: rule(x).hex() for x in WRITTEN[name]} == WRITTEN[name]
