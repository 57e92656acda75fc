"""What a drone plans, as it tells those who look on: a few points of its way. Nothing that flies depends on it.

A plan that lies is drawn at worst where its own drone could be (`are_near`).
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import TICK_S

SHOWN = 4  # points
LONGEST = 1000  # ticks; nobody plans further ahead
_LAYOUT = np.dtype([("after", "<u2", SHOWN), ("place", "<f4", (SHOWN, 2))])
PLAN_BYTES = _LAYOUT.itemsize
_BESIDE_M = 1.0


class Planned(NamedTuple):
    """K plans, or one where K is left out. after: (K, SHOWN) ticks after it was planned. place: (K, SHOWN, 2) m, where the drone
    is to be then, in the common frame."""

    after: NDArray[np.integer[Any]]
    place: NDArray[np.float32]


def pack_plan(planned: Planned) -> bytes:
    """A plan as it travels."""
    return planned.after.astype("<u2").tobytes() + planned.place.astype("<f4").tobytes()


def unpack_plans(data: bytes) -> Planned:
    """K times what `pack_plan` made, of `PLAN_BYTES` each."""
    rows = np.frombuffer(data, _LAYOUT)
    return Planned(rows["after"], rows["place"])


def are_near(
    planned: Planned, age: NDArray[np.int64], position: NDArray[np.float64], speed_mps: float
) -> NDArray[np.bool_]:
    """Which of K plans, made ``age`` (K,) ticks ago, are of places for drones that are at ``position`` (K, 2) m now and fly at
    most that fast: no farther than they have come since then, and come till then, at twice their speed, and a metre."""
    far_m = np.linalg.norm(planned.place - position[:, None], axis=2)
    near = far_m <= 2 * speed_mps * TICK_S * (planned.after + age[:, None]) + _BESIDE_M
    return np.asarray((near & (planned.after <= LONGEST)).all(axis=1))
