"""What is around one drone, as every rule of its controller takes it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Neighbours(NamedTuple):
    """The first ``size`` rows of rel [m] and vel [m/s], (K, 2), neighbour minus me."""

    size: int
    rel: NDArray[np.float64]
    vel: NDArray[np.float64]


class Discs(NamedTuple):
    """The first ``size`` <= 62 obstacles: rel (M, 2) centre minus me [m], radius (M,) [m].

    side: (M,) int8 on which each is being passed: 0 undecided, +1 left, -1 right; the obstacle terms' memory.
    """

    size: int
    rel: NDArray[np.float64]
    radius: NDArray[np.float64]
    side: NDArray[np.int8]
