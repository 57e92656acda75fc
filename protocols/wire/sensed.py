"""What a drone's own sensors tell it each tick, as rows of arrays (one row per drone), and how a row travels.

Positions and velocities are in the common local frame (metres, m/s; x forward, y left). Neighbours and obstacles are
relative to the drone: other minus me, obstacle centre minus me.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.wire.rows import bytes_of

MAX_NEAR = 48  # neighbours sensed at once
MAX_OBSTACLES = 16

#: A neighbour: its number, and its position [m] and velocity [m/s] minus mine.
NEIGHBOUR = np.dtype([("number", "<i8"), ("x", "<f8"), ("y", "<f8"), ("vx", "<f8"), ("vy", "<f8")])
#: An obstacle: its centre minus me [m], and its radius [m].
DISC = np.dtype([("x", "<f8"), ("y", "<f8"), ("radius", "<f8")])
_VECTOR_BYTES = 2 * 8
OWN_BYTES = 2 * _VECTOR_BYTES  # own position and velocity

Packed = tuple[bytes, bytes, bytes]


class Sensed(NamedTuple):
    """One row per drone.

    position [m], velocity [m/s]: (A, 2) own.
    near_count: (A,) rows used of near. near: (A, MAX_NEAR) of NEIGHBOUR, by rising number.
    obstacle_count: (A,) rows used of obstacles. obstacles: (A, MAX_OBSTACLES) of DISC.
    """

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    near_count: NDArray[np.int64]
    near: NDArray[Any]
    obstacle_count: NDArray[np.int64]
    obstacles: NDArray[Any]


def empty_sensed(rows: int) -> Sensed:
    """Room for ``rows`` drones, nothing sensed."""
    return Sensed(
        np.zeros((rows, 2)),
        np.zeros((rows, 2)),
        np.zeros(rows, np.int64),
        np.zeros((rows, MAX_NEAR), NEIGHBOUR),
        np.zeros(rows, np.int64),
        np.zeros((rows, MAX_OBSTACLES), DISC),
    )


class SensedPacker:
    """Packs rows as they are at the moment of packing, by copying bytes."""

    def __init__(self, sensed: Sensed) -> None:
        self._near_count, self._obstacle_count = sensed.near_count.data, sensed.obstacle_count.data
        self._position, self._velocity = bytes_of(sensed.position), bytes_of(sensed.velocity)
        self._near, self._obstacles = bytes_of(sensed.near), bytes_of(sensed.obstacles)

    def pack(self, row: int) -> Packed:
        """One row as three byte strings: own position and velocity, neighbours, obstacles."""
        own, near, obstacle = (
            row * _VECTOR_BYTES,
            row * MAX_NEAR * NEIGHBOUR.itemsize,
            row * MAX_OBSTACLES * DISC.itemsize,
        )
        return (
            self._position[own : own + _VECTOR_BYTES].tobytes()
            + self._velocity[own : own + _VECTOR_BYTES].tobytes(),
            self._near[near : near + self._near_count[row] * NEIGHBOUR.itemsize].tobytes(),
            self._obstacles[obstacle : obstacle + self._obstacle_count[row] * DISC.itemsize].tobytes(),
        )


class SensedReader:
    """Writes what `SensedPacker` made into row 0 of a drone's own arrays, by copying bytes."""

    def __init__(self, sensed: Sensed) -> None:
        self._near_count, self._obstacle_count = sensed.near_count.data, sensed.obstacle_count.data
        self._position, self._velocity, self._near, self._obstacles = (
            bytes_of(array[0]) for array in (sensed.position, sensed.velocity, sensed.near, sensed.obstacles)
        )

    def read(self, data: bytes, at: int, near: int, obstacles: int) -> None:
        """Take in one tick: the three byte strings one after the other in ``data`` from ``at`` on, with so many neighbours and
        obstacles, no more than have room.
        """
        self._position[:] = data[at : at + _VECTOR_BYTES]
        self._velocity[:] = data[at + _VECTOR_BYTES : at + OWN_BYTES]
        near_at, near_bytes = at + OWN_BYTES, near * NEIGHBOUR.itemsize
        obstacles_at, obstacles_bytes = near_at + near_bytes, obstacles * DISC.itemsize
        self._near[:near_bytes] = data[near_at : near_at + near_bytes]
        self._obstacles[:obstacles_bytes] = data[obstacles_at : obstacles_at + obstacles_bytes]
        self._near_count[0], self._obstacle_count[0] = near, obstacles
