"""What a drone's own sensors tell it each tick, as rows of arrays (one row per drone), and how a row travels.

Positions and velocities are in the common local frame (metres, m/s; x forward, y left). Neighbours and obstacles are
relative to the drone: other minus me, obstacle centre minus me.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

MAX_NEAR = 48  # neighbours sensed at once
MAX_OBSTACLES = 16

Packed = tuple[bytes, bytes, bytes]


class Sensed(NamedTuple):
    """One row per drone.

    motion: (A, 8) own p, own v, virtual target p, virtual target v.
    near_count: (A,) rows used of near.
    near: (A, MAX_NEAR, 5) agent number, relative position (2), relative velocity (2), by rising agent number.
    obstacle_count: (A,) rows used of obstacles.
    obstacles: (A, MAX_OBSTACLES, 3) relative centre (2), radius.
    """

    motion: NDArray[np.float64]
    near_count: NDArray[np.int64]
    near: NDArray[np.float64]
    obstacle_count: NDArray[np.int64]
    obstacles: NDArray[np.float64]


def empty_sensed(rows: int) -> Sensed:
    """Room for ``rows`` drones, nothing sensed."""
    return Sensed(
        np.zeros((rows, 8)),
        np.zeros(rows, np.int64),
        np.zeros((rows, MAX_NEAR, 5)),
        np.zeros(rows, np.int64),
        np.zeros((rows, MAX_OBSTACLES, 3)),
    )


def pack_sensed(sensed: Sensed, row: int) -> Packed:
    """One row as three byte strings of little-endian doubles."""
    return (
        sensed.motion[row].tobytes(),
        sensed.near[row, : sensed.near_count[row]].tobytes(),
        sensed.obstacles[row, : sensed.obstacle_count[row]].tobytes(),
    )


def unpack_sensed(packed: Packed, sensed: Sensed, row: int) -> None:
    """Fill ``row`` from `pack_sensed`'s bytes.

    Raises:
        ValueError: the byte strings are not whole rows, or too many.
    """
    motion, near, obstacles = packed
    sensed.motion[row] = np.frombuffer(motion)
    near_rows = np.frombuffer(near).reshape(-1, 5)
    obstacle_rows = np.frombuffer(obstacles).reshape(-1, 3)
    if len(near_rows) > MAX_NEAR or len(obstacle_rows) > MAX_OBSTACLES:
        raise ValueError(f"{len(near_rows)} neighbours and {len(obstacle_rows)} obstacles are more than a drone senses")
    sensed.near_count[row] = len(near_rows)
    sensed.near[row, : len(near_rows)] = near_rows
    sensed.obstacle_count[row] = len(obstacle_rows)
    sensed.obstacles[row, : len(obstacle_rows)] = obstacle_rows
