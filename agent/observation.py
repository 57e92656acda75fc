"""Where a drone should be, and its observation X_i: the 18 numbers of the paper's Sec. II-B1.

    0:2    error of the slot target, compressed e / (1 + |e|/2)
    2:4    (v - v_target) / 2
    4:10   the two nearest obstacles: outward normal x s (2) and radius x s (1) each, nearest first
    10:18  the two nearest neighbours: normal x s (2) and relative velocity x s/2 (2) each, nearest first

s = (R - d) / R falls from 1 at contact to 0 at the sensing range R, so what comes into sight starts at zero; normals
point from the other to the drone. Nothing seen is all zeros. Everything is relative: no number depends on N or on where
on the map the drone is.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from agent.control.attraction import Aim
from agent.memory import Memory
from agent.tick_arrays import Views, Work
from protocols.arithmetic import length
from protocols.dynamics import vector
from protocols.kernels import inlined_kernel
from protocols.mission.formation import NO_PARENT
from protocols.relative import UNKNOWN
from protocols.slots.trigger import Shape
from protocols.wire.sensed import Sensed

WIDE_SIZE = 32
WIDE_REACH_M = 10.0


@inlined_kernel
def aim_row(
    row: int, chain: bool, shape: Shape, views: Views, work: Work, sensed: Sensed, memory: Memory
) -> None:
    """One row's targets minus its position [m], written to ``work.chain_error`` and ``work.slot_error``.

    slot:  virtual target + the slot's offset.
    chain: p_{i -> tar(i)} = p_{i -> leader} + (slot offset - leader's slot offset) (paper, Sec. II-B1), over at most three
           hops; the root's target is the virtual target. A leader out of reach falls back to the slot target. Without
           ``chain`` both errors are the slot's.
    """
    position, target, offsets = sensed.position[row], work.target_position[row], shape.offsets
    chain_error, slot_error = work.chain_error, work.slot_error
    slot = views.slot_of[row, work.me[row]]
    slot_error[row, 0] = target[0] + offsets[slot, 0] - position[0]
    slot_error[row, 1] = target[1] + offsets[slot, 1] - position[1]
    chain_error[row, 0], chain_error[row, 1] = slot_error[row, 0], slot_error[row, 1]
    above = shape.parent[slot]
    if chain and above != NO_PARENT:
        leader = views.occupant[row, above]
        if memory.hops[row, leader] != UNKNOWN:
            chain_error[row, 0] = memory.rel[row, leader, 0] + offsets[slot, 0] - offsets[above, 0]
            chain_error[row, 1] = memory.rel[row, leader, 1] + offsets[slot, 1] - offsets[above, 1]


@inlined_kernel
def aim_of(row: int, work: Work, sensed: Sensed) -> Aim:
    """One row's targets and velocities as its controller takes them."""
    return Aim(
        vector(work.chain_error, row), vector(work.slot_error, row), vector(sensed.velocity, row),
        vector(work.target_velocity, row),
    )  # fmt: skip


@inlined_kernel
def _obstacle_gap(row: int, index: int, memory: Memory) -> float:
    centre: float = length(memory.obstacle_rel[row, index, 0], memory.obstacle_rel[row, index, 1])
    return centre - float(memory.obstacle_radius[row, index])


@inlined_kernel
def _obstacles(row: int, count: int, reach: float, memory: Memory, x: NDArray[Any], place: int) -> None:
    """The ``count`` nearest obstacles within ``reach`` [m] of the surface, nearest first: normal x s (2), radius x s."""
    last, last_gap = -1, -np.inf
    for _ in range(count):
        best, best_gap = -1, reach
        for index in range(memory.disc_count[row]):
            gap = _obstacle_gap(row, index, memory)
            if gap < best_gap and (gap > last_gap or (gap == last_gap and index > last)):
                best, best_gap = index, gap
        if best < 0:
            break
        rel, radius = memory.obstacle_rel[row, best], memory.obstacle_radius[row, best]
        s = min((reach - best_gap) / reach, 1.0)
        centre = max(length(rel[0], rel[1]), 1e-9)
        x[place], x[place + 1], x[place + 2] = -rel[0] / centre * s, -rel[1] / centre * s, radius * s
        last, last_gap = best, best_gap
        place += 3


@inlined_kernel
def _neighbours(row: int, count: int, reach: float, memory: Memory, x: NDArray[Any], place: int) -> None:
    """The ``count`` nearest neighbours within ``reach`` [m], nearest first: normal x s (2), relative velocity x s/2 (2)."""
    last, last_gap = -1, -np.inf
    for _ in range(count):
        best, best_gap = -1, reach
        for index in range(memory.near_count[row]):
            gap = length(memory.near_rel[row, index, 0], memory.near_rel[row, index, 1])
            if gap < best_gap and (gap > last_gap or (gap == last_gap and index > last)):
                best, best_gap = index, gap
        if best < 0:
            break
        rel, vel = memory.near_rel[row, best], memory.near_vel[row, best]
        s = (reach - best_gap) / reach
        centre = max(best_gap, 1e-9)
        x[place], x[place + 1] = -rel[0] / centre * s, -rel[1] / centre * s
        x[place + 2], x[place + 3] = 0.5 * vel[0] * s, 0.5 * vel[1] * s
        last, last_gap = best, best_gap
        place += 4


@inlined_kernel
def compressed(x: float, y: float) -> tuple[float, float]:
    """An error [m] as policies see it: e / (1 + |e|/2), which tells direction far away and distance nearby."""
    scale = 1.0 / (1.0 + 0.5 * length(x, y))
    return x * scale, y * scale


@inlined_kernel
def observe_row(row: int, reach: float, work: Work, sensed: Sensed, memory: Memory, x: NDArray[Any]) -> None:
    """Fill ``x`` (18,) of any float type; ``reach`` is the sensing range [m]."""
    velocity, target_velocity = sensed.velocity[row], work.target_velocity[row]
    for place in range(x.shape[0]):
        x[place] = 0.0
    x[0], x[1] = compressed(work.slot_error[row, 0], work.slot_error[row, 1])
    x[2], x[3] = 0.5 * (velocity[0] - target_velocity[0]), 0.5 * (velocity[1] - target_velocity[1])
    _obstacles(row, 2, reach, memory, x, 4)
    _neighbours(row, 2, reach, memory, x, 10)


@inlined_kernel
def observe_wide_row(row: int, reach: float, memory: Memory, x: NDArray[Any]) -> None:
    """Fill ``x`` (32,): more of the same for a drone's own use, not broadcast.

    0:12   the four nearest obstacles out to `WIDE_REACH_M` (those out of sight are remembered), as above
    12:32  the five nearest neighbours, as above
    """
    for place in range(x.shape[0]):
        x[place] = 0.0
    _obstacles(row, 4, WIDE_REACH_M, memory, x, 0)
    _neighbours(row, 5, reach, memory, x, 12)
