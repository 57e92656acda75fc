"""The point of a disc that keeps half-planes: a small 2-D program, solved the way ORCA does.

A row ``(n_x, n_y, bound)`` asks for ``n·a >= bound`` with a unit vector ``n``; the disc is ``|a| <= radius``.
Rows are added one after another; only a row that the best point so far breaks moves it, and then to that
row's edge. Where the rows contradict each other, the worst violation is made as small as possible, which is
the same program one dimension up.

After van den Berg, Guy, Lin, Manocha, "Reciprocal n-body collision avoidance" (linear programs 1, 2 and 3).
"""

import math

import numpy as np
from numpy.typing import NDArray

from protocols.kernels import allocating_kernel, kernel

_PARALLEL = 1e-9  #: sine of the angle below which two edges count as parallel
_SLACK = 1e-9  #: violation that counts as none


@kernel
def _on_line(
    i: int,
    rows: NDArray[np.float64],
    radius: float,
    goal_x: float,
    goal_y: float,
    farthest: bool,
) -> tuple[bool, float, float]:
    """Best point on the edge of row ``i`` within the disc and the rows before it (ORCA's first program).

    Best is nearest to ``goal``, or farthest along it. False where there is no such point.
    """
    n_x = rows[i, 0]
    n_y = rows[i, 1]
    bound = rows[i, 2]
    room = radius * radius - bound * bound
    if room < 0.0:
        return False, 0.0, 0.0
    high = math.sqrt(room)
    low = -high
    for j in range(i):
        slope = rows[j, 0] * n_y - rows[j, 1] * n_x
        lack = rows[j, 2] - bound * (rows[j, 0] * n_x + rows[j, 1] * n_y)
        if abs(slope) <= _PARALLEL:
            if lack > _SLACK:
                return False, 0.0, 0.0
        elif slope > 0.0:
            low = max(low, lack / slope)
        else:
            high = min(high, lack / slope)
        if low > high:
            return False, 0.0, 0.0
    t = goal_x * n_y - goal_y * n_x
    if farthest:
        t = math.copysign(math.inf, t)
    t = min(max(t, low), high)
    return True, bound * n_x + t * n_y, bound * n_y - t * n_x


@kernel
def nearest_point(
    count: int,
    rows: NDArray[np.float64],
    radius: float,
    goal_x: float,
    goal_y: float,
    farthest: bool,
) -> tuple[int, float, float]:
    """Best point within the disc and all rows (ORCA's second program).

    Returns ``(count, x, y)``, or the first row that cannot be kept and the best point for those before it.
    """
    x = goal_x
    y = goal_y
    length = math.sqrt(x * x + y * y)
    if farthest or length > radius:
        x *= radius / length
        y *= radius / length
    for i in range(count):
        if rows[i, 0] * x + rows[i, 1] * y < rows[i, 2] - _SLACK:
            found, new_x, new_y = _on_line(i, rows, radius, goal_x, goal_y, farthest)
            if not found:
                return i, x, y
            x = new_x
            y = new_y
    return count, x, y


@allocating_kernel
def least_violation(
    begin: int,
    count: int,
    hard: int,
    rows: NDArray[np.float64],
    radius: float,
    x: float,
    y: float,
) -> tuple[float, float]:
    """Point that keeps the first ``hard`` rows and violates the rest least (ORCA's third program).

    ``x, y`` is a point that keeps the rows before ``begin``.
    """
    worst = 0.0
    inner = np.empty((count, 3))
    for i in range(begin, count):
        if rows[i, 2] - rows[i, 0] * x - rows[i, 1] * y <= worst + _SLACK:
            continue
        # Make row i the worst and push it: where row j is violated no more than row i is again a half-plane.
        size = hard
        for j in range(hard):
            for c in range(3):
                inner[j, c] = rows[j, c]
        for j in range(hard, i):
            n_x = rows[j, 0] - rows[i, 0]
            n_y = rows[j, 1] - rows[i, 1]
            length = math.sqrt(n_x * n_x + n_y * n_y)
            if length > 1e-6:
                inner[size, 0] = n_x / length
                inner[size, 1] = n_y / length
                inner[size, 2] = (rows[j, 2] - rows[i, 2]) / length
                size += 1
        done, new_x, new_y = nearest_point(size, inner, radius, rows[i, 0], rows[i, 1], True)
        if done == size:
            x = new_x
            y = new_y
        worst = rows[i, 2] - rows[i, 0] * x - rows[i, 1] * y
    return x, y
