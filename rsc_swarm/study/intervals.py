"""How far a rate that was measured can be trusted: 95 % intervals, and what no failure at all says.

Flights from several starts on one map are not independent of each other: a map that is hard fails several. So a rate is as
sure as the maps make it, and not as the flights do.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_Z = 1.959964  # 95 %
_DRAWS = 4000  # of the bootstrap


def wilson(successes: int, runs: int) -> tuple[float, float]:
    """The 95 % Wilson interval of a success rate, of runs that are independent."""
    share, spread = successes / runs, _Z * _Z / runs
    middle = (share + spread / 2) / (1 + spread)
    half = _Z / (1 + spread) * math.sqrt(share * (1 - share) / runs + spread / (4 * runs))
    return max(0.0, middle - half), min(1.0, middle + half)


def clustered(success: Sequence[bool], maps: Sequence[int]) -> tuple[float, float]:
    """The 95 % interval of a success rate over flights on some ``maps``, one of both per flight.

    With one flight a map, or one map, Wilson's. Else a bootstrap over maps (percentiles, always the same draws), which takes
    flights on a map for as much alike as they were. Where all flights ended alike that cannot be seen, and the interval is
    Wilson's of so many maps.
    """
    places, index = np.unique(np.asarray(maps), return_inverse=True)
    wins = np.bincount(index, np.asarray(success, float), len(places)).astype(float)
    runs = np.bincount(index, minlength=len(places)).astype(float)
    total = int(wins.sum())
    if len(places) in (1, len(success)):
        return wilson(total, len(success))
    if total in (0, len(success)):
        return wilson(len(places) if total else 0, len(places))
    low, high = np.quantile(_drawn(wins, runs), (0.025, 0.975))
    return float(low), float(high)


def _drawn(wins: NDArray[np.float64], runs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rates over as many maps as there are, drawn from them with putting back."""
    maps = len(runs)
    times = np.random.default_rng(0).multinomial(maps, np.full(maps, 1 / maps), _DRAWS)
    rates: NDArray[np.float64] = (times @ wins) / (times @ runs)
    return rates


def failure_bound(trials: int) -> float:
    """The failure rate is below this with 95 % confidence after so many independent trials without one; about 3 / trials."""
    return float(1 - 0.05 ** (1 / trials))
