"""Functions whose results are the same bits on every machine, for rules that decide a flight.

Those of the C library are rounded as it pleases: by its version, and by whether the processor has FMA. These are made of what
IEEE 754 rounds in one way only: +, -, * and /, in a fixed order, and whole numbers.
"""

import math

import numpy as np

from protocols.kernels import inlined_kernel

_LARGEST, _SMALLEST = 709.782712893384, -745.1332191019411  # beyond: infinite, and 0
_PER_LN2 = 1.4426950408889634  # 1 / ln 2
# ln 2 in two parts. The first has 33 bits, so that its product with a whole number of up to 2^20 is exact.
_LN2_HIGH, _LN2_LOW = 0.6931471803691238, 1.9082149292705877e-10


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
