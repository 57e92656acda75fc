"""The Ticks of all drones, written in one go into one buffer (protocols.wire.messages has the layout)."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.kernels import bound, by_reference, inlined_kernel, kernel
from protocols.wire.frames import MAX_FRAME_BYTES
from protocols.wire.heard import ENTRY_BYTES
from protocols.wire.messages import TICK_HEAD, TICK_MARK
from protocols.wire.rows import as_bytes, put_bytes, put_number
from protocols.wire.sensed import DISC, NEIGHBOUR, OWN_BYTES
from world.core import WorldCore

_HEAD_BYTES, _NEAR_BYTES, _DISC_BYTES = TICK_HEAD.size, NEIGHBOUR.itemsize, DISC.itemsize


class Frames(NamedTuple):
    """What each of N drones sent, for as long as it can still arrive, by tick % D: (D, N, MAX_FRAME_BYTES), and (D, N) bytes."""

    data: NDArray[np.uint8]
    size: NDArray[np.int64]


def empty_frames(core: WorldCore) -> Frames:
    """Nobody has sent anything."""
    shape = core.ring, core.shape[1]
    return Frames(np.zeros((*shape, MAX_FRAME_BYTES), np.uint8), np.zeros(shape, np.int64))


class _Desk(NamedTuple):
    """Everything `_write_ticks` works on.

    tick: (2,) and its proof. awake: (N,). near_count, obstacle_count, followed: (N,). motion, near, obstacles: (N, ...) bytes as
    they travel; own position and velocity apart. start, arrived: as world.core.Inbox. bounds: (N + 1,) out: the Tick of drone r
    is written[bounds[r]:bounds[r + 1]].
    """

    tick: NDArray[np.int64]
    awake: NDArray[np.bool_]
    near_count: NDArray[np.int64]
    obstacle_count: NDArray[np.int64]
    position: NDArray[np.uint8]
    velocity: NDArray[np.uint8]
    near: NDArray[np.uint8]
    obstacles: NDArray[np.uint8]
    followed: NDArray[np.int64]
    start: NDArray[np.int64]
    arrived: NDArray[np.int32]
    frames: Frames
    bounds: NDArray[np.int64]
    written: NDArray[np.uint8]


@inlined_kernel
def _size_of(row: int, desk: _Desk) -> int:
    size: int = _HEAD_BYTES + OWN_BYTES
    size += desk.near_count[row] * _NEAR_BYTES + desk.obstacle_count[row] * _DISC_BYTES
    for index in range(desk.start[row], desk.start[row + 1]):
        source, sent = desk.arrived[index, 0], desk.arrived[index, 1]
        size += ENTRY_BYTES + desk.frames.size[sent % desk.frames.size.shape[0], source]
    return size


@kernel
def _write_ticks(desk: _Desk) -> int:
    """Write a Tick for every awake drone, if there is room for all.

    Returns:
        How many bytes they take.
    """
    tick, proof, awake = desk.tick[0], desk.tick[1], desk.awake
    bounds, out, frames, agents = desk.bounds, desk.written, desk.frames, awake.shape[0]
    bounds[0] = 0
    for row in range(agents):
        bounds[row + 1] = bounds[row] + (_size_of(row, desk) if awake[row] else 0)
    total = int(bounds[agents])
    if total > out.shape[0]:
        return total
    for row in range(agents):
        if not awake[row]:
            continue
        near, obstacles = desk.near_count[row], desk.obstacle_count[row]
        at = put_number(out, bounds[row], TICK_MARK, 1)
        at = put_number(out, at, obstacles, 1)
        at = put_number(out, at, near, 2)
        at = put_number(out, at, tick, 4)
        at = put_number(out, at, proof, 4)
        at = put_number(out, at, desk.followed[row], 4)
        at = put_number(out, at, desk.start[row + 1] - desk.start[row], 4)
        at = put_bytes(out, at, desk.position[row], 0, desk.position.shape[1])
        at = put_bytes(out, at, desk.velocity[row], 0, desk.velocity.shape[1])
        at = put_bytes(out, at, desk.near[row], 0, near * _NEAR_BYTES)
        at = put_bytes(out, at, desk.obstacles[row], 0, obstacles * _DISC_BYTES)
        for index in range(desk.start[row], desk.start[row + 1]):
            source = desk.arrived[index, 0]
            bucket = desk.arrived[index, 1] % frames.size.shape[0]
            size = frames.size[bucket, source]
            at = put_number(out, at, source, 2)
            at = put_number(out, at, size, 2)
            at = put_bytes(out, at, frames.data[bucket, source], 0, size)
    return total


class Questions:
    """Writes the Ticks of one world's drones."""

    def __init__(self, core: WorldCore, frames: Frames) -> None:
        agents = core.shape[1]
        self._core, self._frames = core, frames
        self._tick, self._awake = np.zeros(2, np.int64), np.zeros(agents, np.bool_)
        self._followed, self._bounds = np.full(agents, -1), np.zeros(agents + 1, np.int64)
        self._make_room(2000 * agents)

    def _make_room(self, size: int) -> None:
        written, core, sensed = np.zeros(size, np.uint8), self._core, self._core.sensed
        self._written = written.data
        desk = by_reference(
            _Desk(
                self._tick, self._awake, sensed.near_count, sensed.obstacle_count, _rows_of(sensed.position),
                _rows_of(sensed.velocity), _rows_of(sensed.near), _rows_of(sensed.obstacles), self._followed,
                core.inbox_start, core.inbox,
                self._frames, self._bounds, written,
            )
        )  # fmt: skip
        self._write = bound(_write_ticks, desk)

    def write(self, tick: int, proof: int, awake: Sequence[int], followed: Sequence[int]) -> list[bytes]:
        """The Tick of every drone that is ``awake``, empty for the others; ``followed``: (N,) as in Tick."""
        self._tick[:] = tick, proof
        self._awake[:] = False
        self._awake[awake] = True
        self._followed[:] = followed
        while (size := self._write()) > len(self._written):
            self._make_room(2 * size)
        bounds = self._bounds.tolist()
        return [self._written[first:end].tobytes() for first, end in pairwise(bounds)]


def _rows_of(array: NDArray[Any]) -> NDArray[np.uint8]:
    """(N, ...) bytes of the rows of an array."""
    return as_bytes(array).reshape(len(array), -1)
