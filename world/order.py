"""The drones of a world in order of x, so that whoever is near another is found among its neighbours there.

A drone moves little in a tick, so that the order of the tick before is nearly right. Whoever looks for drones near others brings
it up to date first, and then looks along it to both sides until the distance in x alone is too large.
"""

import numpy as np
from numpy.typing import NDArray

from protocols.kernels import inlined_kernel


def any_order(worlds: int, agents: int) -> NDArray[np.int64]:
    """(E, N) drone numbers, to be put in order."""
    return np.tile(np.arange(agents), (worlds, 1))


@inlined_kernel
def put_in_order(by_x: NDArray[np.int64], position: NDArray[np.float64]) -> None:
    """Put the numbers (N,) of one world's drones in order of their x; position: (N, 2) [m]."""
    for place in range(1, by_x.shape[0]):
        agent = by_x[place]
        x, at = position[agent, 0], place
        while at > 0 and position[by_x[at - 1], 0] > x:
            by_x[at] = by_x[at - 1]
            at -= 1
        by_x[at] = agent


@inlined_kernel
def _is_within(dx: float, reach: float) -> bool:
    """As whoever looks at the distance sees it, by squares: rounded, they may be equal where the numbers are not."""
    return dx * dx <= reach * reach


@inlined_kernel
def span(by_x: NDArray[np.int64], position: NDArray[np.float64], place: int, reach: float) -> tuple[int, int]:
    """Where in the order those are whose x is within ``reach`` [m] of that of the drone at ``place``: from the first to before
    the last."""
    x, first, last = position[by_x[place], 0], place, place + 1
    while first > 0 and _is_within(x - position[by_x[first - 1], 0], reach):
        first -= 1
    while last < by_x.shape[0] and _is_within(position[by_x[last], 0] - x, reach):
        last += 1
    return first, last
