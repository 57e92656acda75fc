"""What a drone plans, as it tells those who look on: a few points of its way. Nothing that flies depends on it.

A plan that lies is drawn at worst where its own drone could be (`is_near`).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import TICK_S

SHOWN = 4  # points
LONGEST = 1000  # ticks; nobody plans further ahead
_LAYOUT = np.dtype([("after", "<u2", SHOWN), ("place", "<f4", (SHOWN, 2))])
PLAN_BYTES = _LAYOUT.itemsize
_BESIDE_M = 1.0


class Planned(NamedTuple):
    """after: (SHOWN,) ticks after it was planned. place: (SHOWN, 2) m, where the drone is to be then, in the common frame."""

    after: NDArray[np.uint16]
    place: NDArray[np.float32]


def pack_plan(planned: Planned) -> bytes:
    """A plan as it travels."""
    row = np.zeros(1, _LAYOUT)
    row["after"][0], row["place"][0] = planned
    return row.tobytes()


def unpack_plan(data: bytes) -> Planned:
    """What `pack_plan` made, of `PLAN_BYTES`."""
    row = np.frombuffer(data, _LAYOUT)
    return Planned(row["after"][0], row["place"][0])


def is_near(planned: Planned, position: NDArray[np.float64], speed_mps: float) -> bool:
    """Whether these are places for a drone that is at ``position`` (2,) m and flies at most that fast: no farther than it is
    then at twice its speed, and a metre."""
    far_m = np.linalg.norm(planned.place - position, axis=1)
    near = far_m <= 2 * speed_mps * TICK_S * planned.after + _BESIDE_M
    return bool((near & (planned.after <= LONGEST)).all())
