"""Where a drone should be, and its observation X_i: the 18 numbers of the paper's Sec. II-B1.

    0:2    error of the slot target, compressed e / (1 + |e|/2)
    2:4    (v - v_target) / 2
    4:10   the two nearest obstacles: outward normal x s (2) and radius x s (1) each, nearest first
    10:18  the two nearest neighbours: normal x s (2) and relative velocity x s/2 (2) each, nearest first

s = (R - d) / R falls from 1 at contact to 0 at the sensing range R, so what comes into sight starts at zero; normals
point from the other to the drone. Nothing seen is all zeros. Everything is relative: no number depends on N or on where
on the map the drone is.
"""

import math

import numpy as np
from numpy.typing import NDArray

from agent.memory import Memory
from protocols.formation import NO_PARENT
from protocols.kernels import inlined_kernel
from protocols.relative import UNKNOWN
from protocols.sensed import Sensed


@inlined_kernel
def aim_row(
    row: int,
    me: int,
    chain: bool,
    sensed: Sensed,
    memory: Memory,
    offsets: NDArray[np.float64],
    parent: NDArray[np.int16],
    slot_of: NDArray[np.int64],
    occupant: NDArray[np.int64],
    chain_error: NDArray[np.float64],
    slot_error: NDArray[np.float64],
) -> None:
    """One row's targets minus its position [m], written to chain_error and slot_error (A, 2).

    slot:  virtual target + the slot's offset.
    chain: p_{i -> tar(i)} = p_{i -> leader} + (slot offset - leader's slot offset) (paper, Sec. II-B1), over at most three
           hops; the root's target is the virtual target. A leader out of reach falls back to the slot target. Without
           ``chain`` both errors are the slot's.
    """
    motion, slot = sensed.motion[row], slot_of[row, me]
    slot_error[row, 0] = motion[4] + offsets[slot, 0] - motion[0]
    slot_error[row, 1] = motion[5] + offsets[slot, 1] - motion[1]
    chain_error[row] = slot_error[row]
    above = parent[slot]
    if chain and above != NO_PARENT:
        leader = occupant[row, above]
        if memory.hops[row, leader] != UNKNOWN:
            chain_error[row, 0] = memory.rel[row, leader, 0] + offsets[slot, 0] - offsets[above, 0]
            chain_error[row, 1] = memory.rel[row, leader, 1] + offsets[slot, 1] - offsets[above, 1]


@inlined_kernel
def _two_nearest(distance: NDArray[np.float64], count: int) -> tuple[int, int]:
    first, second = -1, -1
    for index in range(count):
        if first < 0 or distance[index] < distance[first]:
            first, second = index, first
        elif second < 0 or distance[index] < distance[second]:
            second = index
    return first, second


@inlined_kernel
def observe_row(
    row: int,
    reach: float,
    sensed: Sensed,
    memory: Memory,
    slot_error: NDArray[np.float64],
    observation: NDArray[np.float64],
) -> None:
    """Fill observation[row] (18,); ``reach`` is the sensing range [m]."""
    x = observation[row]
    x[:] = 0.0
    ex, ey = slot_error[row, 0], slot_error[row, 1]
    compress = 1.0 / (1.0 + 0.5 * math.hypot(ex, ey))
    motion = sensed.motion[row]
    x[0], x[1] = ex * compress, ey * compress
    x[2], x[3] = 0.5 * (motion[2] - motion[6]), 0.5 * (motion[3] - motion[7])
    distance = np.empty(max(memory.near_rel.shape[1], memory.obstacle_rel.shape[1]))
    for index in range(memory.disc_count[row]):
        rel = memory.obstacle_rel[row, index]
        distance[index] = math.hypot(rel[0], rel[1]) - memory.obstacle_radius[row, index]
    place = 4
    for index in _two_nearest(distance, memory.disc_count[row]):
        if index >= 0 and distance[index] < reach:
            rel, radius = memory.obstacle_rel[row, index], memory.obstacle_radius[row, index]
            s = min((reach - distance[index]) / reach, 1.0)
            centre = max(math.hypot(rel[0], rel[1]), 1e-9)
            x[place], x[place + 1], x[place + 2] = -rel[0] / centre * s, -rel[1] / centre * s, radius * s
        place += 3
    for index in range(memory.near_count[row]):
        distance[index] = math.hypot(memory.near_rel[row, index, 0], memory.near_rel[row, index, 1])
    for index in _two_nearest(distance, memory.near_count[row]):
        if index >= 0 and distance[index] < reach:
            rel, vel = memory.near_rel[row, index], memory.near_vel[row, index]
            s = (reach - distance[index]) / reach
            centre = max(distance[index], 1e-9)
            x[place], x[place + 1] = -rel[0] / centre * s, -rel[1] / centre * s
            x[place + 2], x[place + 3] = 0.5 * vel[0] * s, 0.5 * vel[1] * s
        place += 4
