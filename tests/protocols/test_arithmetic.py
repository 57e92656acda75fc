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


def test_exp_is_what_it_was_on_whatever_machine_this_is() -> None:
    """Bits written down once: another compiler or processor that gives others is found here, before flights are compared."""
    found = [arithmetic.exp(x).hex() for x in (1.0, -0.1, -3.7, 12.25, -700.3, -740.0)]
    assert found == WRITTEN["exp"]


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_exp_compiled_and_not_gives_the_same_bits() -> None:
    values = [
        *DRAW.uniform(-750.0, 715.0, 500).tolist(),
        *DRAW.normal(size=500).tolist(),
        math.inf,
        -math.inf,
    ]
    python = interpreted(arithmetic.exp)
    assert [arithmetic.exp(x).hex() for x in values] == [python(x).hex() for x in values]


WRITTEN = {
    "exp": [
        "0x1.5bf0a8b14576ap+1", "0x1.cf46d99d52b3ap-1", "0x1.9511fc6871044p-6",
        "0x1.982aa4f9aec90p+17", "0x1.9a5615b10648ap-1011", "0x0.0000000000055p-1022",
    ],
}  # fmt: skip
