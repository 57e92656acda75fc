"""Whom a drone knows the way to, in the two forms in which its rules have it."""

import numpy as np
from numpy.typing import NDArray

from protocols.relative import MAX_HOPS, Within


def within(hops: NDArray[np.int64]) -> Within:
    """Whom a drone with these hops (N,) to all knows the way to."""
    number = np.concatenate([np.flatnonzero(hops == distance) for distance in range(1, MAX_HOPS + 1)])
    return Within(number, np.array([np.sum((hops > 0) & (hops <= most)) for most in range(MAX_HOPS + 1)]))
