"""Functions whose results are the same bits on every machine, for rules that decide a flight.

Those of the C library are rounded as it pleases: by its version, and by whether the processor has FMA. These are made of what
IEEE 754 rounds in one way only, +, -, *, / and the square root, in a fixed order, and of whole numbers.
"""

import math

import numpy as np

from protocols.kernels import inlined_kernel

_LARGEST, _SMALLEST = 709.782712893384, -745.1332191019411  # beyond: infinite, and 0
_PER_LN2 = 1.4426950408889634  # 1 / ln 2
# ln 2 in two parts. The first has 33 bits, so that its product with a whole number of up to 2^20 is exact.
_LN2_HIGH, _LN2_LOW = 0.6931471803691238, 1.9082149292705877e-10

# π/2 likewise.
_PER_QUARTER, _FARTHEST = 0.6366197723675814, 1e6
_QUARTER_HIGH, _QUARTER_LOW = 1.5707963267341256, 6.077100506506192e-11


@inlined_kernel
def _power_of_two(exponent: int) -> float:
    """2^exponent, exactly, from -1022 to 1023: the number is made of its bits."""
    return float(np.int64((exponent + 1023) << 52).view(np.float64))


@inlined_kernel
def exp(x: float) -> float:
    """e^x, wrong by at most 1 unit in the last place; infinite beyond the largest number, and NaN where x is.

    x is k ln 2 + r, with ln 2 in two parts (W. J. Cody, W. Waite, "Software Manual for the Elementary Functions", 1980) and
    |r| at most 0.35; e^r is 13 terms of its series, of which the next would be less than 1e-17; and 2^k is exact.
    """
    if not x <= _LARGEST:
        return x if x != x else math.inf
    if x < _SMALLEST:
        return 0.0
    k = int(x * _PER_LN2 + (0.5 if x > 0.0 else -0.5))
    high, low = x - k * _LN2_HIGH, k * _LN2_LOW
    r = high - low
    s = r * r
    # Summed in pairs: the processor works on several at a time.
    a = (1 / 2 + r * (1 / 6)) + s * (1 / 24 + r * (1 / 120))
    b = (1 / 720 + r * (1 / 5040)) + s * (1 / 40320 + r * (1 / 362880))
    c = (1 / 3628800 + r * (1 / 39916800)) + s * (1 / 479001600 + r * (1 / 6227020800))
    q = s * s
    tail = s * (a + q * (b + q * c))
    y = 1.0 + (high - (low - tail))
    half = k >> 1  # 2^k itself need not be a number, where y 2^k is one
    return y * _power_of_two(half) * _power_of_two(k - half)


@inlined_kernel
def _sine(x: float, quarters: int) -> float:
    """sin(x + quarters π/2): x is k π/2 + r, with π/2 in two parts and |r| at most π/4, for which the series are short."""
    if not abs(x) <= _FARTHEST:
        return math.nan
    k = int(x * _PER_QUARTER + (0.5 if x > 0.0 else -0.5))
    r = (x - k * _QUARTER_HIGH) - k * _QUARTER_LOW
    s = r * r
    k += quarters
    if k & 1:
        a = 1 / 40320 + s * (
            -1 / 3628800 + s * (1 / 479001600 + s * (-1 / 87178291200 + s * (1 / 20922789888000)))
        )
        y = 1.0 + s * (-1 / 2 + s * (1 / 24 + s * (-1 / 720 + s * a)))
    else:
        a = -1 / 39916800 + s * (1 / 6227020800 + s * (-1 / 1307674368000 + s * (1 / 355687428096000)))
        y = r + r * (s * (-1 / 6 + s * (1 / 120 + s * (-1 / 5040 + s * (1 / 362880 + s * a)))))
    return -y if k & 2 else y


@inlined_kernel
def sine(x: float) -> float:
    """sin x, wrong by at most 2e-16, for |x| up to a million; NaN beyond."""
    return _sine(x, 0)


@inlined_kernel
def cosine(x: float) -> float:
    """cos x, wrong by at most 2e-16, for |x| up to a million; NaN beyond."""
    return _sine(x, 1)


@inlined_kernel
def length(x: float, y: float) -> float:
    """Of the vector (x, y), as long as its square is a number: up to 1e154."""
    return math.sqrt(x * x + y * y)
