"""What a drone's own sensors tell it each tick, as rows of arrays (one row per drone), and how a row travels.

Positions and velocities are in the common local frame (metres, m/s; x forward, y left). Neighbours and obstacles are
relative to the drone: other minus me, obstacle centre minus me.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.wire.rows import bytes_of

MAX_NEAR = 48  # neighbours sensed at once
MAX_OBSTACLES = 16
_MOTION_BYTES, _NEAR_BYTES, _OBSTACLE_BYTES = 4 * 8, 5 * 8, 3 * 8

Packed = tuple[bytes, bytes, bytes]


class Sensed(NamedTuple):
    """One row per drone.

    motion: (A, 4) own p, own v.
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
        np.zeros((rows, 4)),
        np.zeros(rows, np.int64),
        np.zeros((rows, MAX_NEAR, 5)),
        np.zeros(rows, np.int64),
        np.zeros((rows, MAX_OBSTACLES, 3)),
    )


class SensedPacker:
    """Packs rows as they are at the moment of packing, by copying bytes."""

    def __init__(self, sensed: Sensed) -> None:
        self._near_count, self._obstacle_count = sensed.near_count.data, sensed.obstacle_count.data
        self._motion, self._near = bytes_of(sensed.motion), bytes_of(sensed.near)
        self._obstacles = bytes_of(sensed.obstacles)

    def pack(self, row: int) -> Packed:
        """One row as three byte strings of little-endian doubles."""
        near, obstacle = row * MAX_NEAR * _NEAR_BYTES, row * MAX_OBSTACLES * _OBSTACLE_BYTES
        return (
            self._motion[row * _MOTION_BYTES : (row + 1) * _MOTION_BYTES].tobytes(),
            self._near[near : near + self._near_count[row] * _NEAR_BYTES].tobytes(),
            self._obstacles[obstacle : obstacle + self._obstacle_count[row] * _OBSTACLE_BYTES].tobytes(),
        )


class SensedReader:
    """Writes what `SensedPacker` made into row 0 of a drone's own arrays, by copying bytes."""

    def __init__(self, sensed: Sensed) -> None:
        self._sensed = sensed
        self._motion, self._near, self._obstacles = (
            bytes_of(array[0]) for array in (sensed.motion, sensed.near, sensed.obstacles)
        )

    def read(self, packed: Packed) -> None:
        """Take in one tick.

        Raises:
            ValueError: the byte strings are not whole rows, or too many.
        """
        motion, near, obstacles = packed
        near_count, near_rest = divmod(len(near), _NEAR_BYTES)
        obstacle_count, obstacle_rest = divmod(len(obstacles), _OBSTACLE_BYTES)
        if near_rest or obstacle_rest or near_count > MAX_NEAR or obstacle_count > MAX_OBSTACLES:
            raise ValueError(f"{len(near)} and {len(obstacles)} bytes are not what a drone senses")
        self._motion[:] = motion
        self._near[: len(near)] = near
        self._obstacles[: len(obstacles)] = obstacles
        self._sensed.near_count[0] = near_count
        self._sensed.obstacle_count[0] = obstacle_count
