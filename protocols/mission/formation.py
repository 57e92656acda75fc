"""Formations: where the slots lie, and the slot tree that holds them together.

Offsets are metres in the formation's frame (x forward along the flight, y to the left), measured from the root slot.
The tree is breadth-first over slots one spacing apart, from the slot nearest the centroid (ties: smallest x, then
smallest |y|, then smallest y), so every tree edge is exactly one spacing long.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SHAPES = ("square", "triangle", "vee", "line")
NO_PARENT = -1
_EDGE_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)  # arrays do not compare to a truth; equal missions have equal layouts
class Formation:
    """The slots of a formation and their tree.

    Attributes:
        offsets: (N, 2) metres from the root slot, x forward, y left.
        parent: (N,) the slot one edge closer to the root; ``NO_PARENT`` for the root.
        root: the slot whose target is the virtual target itself.
        spacing: length of every tree edge, metres.
    """

    offsets: NDArray[np.float64]
    parent: NDArray[np.int16]
    root: int
    spacing: float

    def __len__(self) -> int:
        return len(self.parent)


def default_shape(agents: int) -> str:
    """The shape flown when none is asked for: a full square if N allows one, else a hollow triangle, else a V."""
    if agents >= 4 and math.isqrt(agents) ** 2 == agents:
        return "square"
    if agents >= 3 and agents % 3 == 0:
        return "triangle"
    return "vee"


def shape_points(shape: str, agents: int, spacing: float) -> NDArray[np.float64]:
    """Slot positions (N, 2), metres, anywhere in the plane.

    Raises:
        ValueError: the shape has no form with this many agents; the message says which counts it has.
    """
    if shape == "square":
        side = math.isqrt(agents)
        if side * side != agents or side < 2:
            raise ValueError(f"a square needs 4, 9, 16, 25, 36, ... agents, not {agents}")
        points = [
            (-row * spacing, (column - (side - 1) / 2) * spacing)
            for row in range(side)
            for column in range(side)
        ]
    elif shape == "triangle":
        if agents % 3 or agents < 3:
            raise ValueError(f"a hollow triangle needs 3, 6, 9, 12, ... agents, not {agents}")
        points = _hollow_triangle(agents // 3, spacing)
    elif shape == "vee":
        step = spacing * math.sqrt(0.5)
        arms = [((index + 1) // 2, 1 if index % 2 else -1) for index in range(agents)]
        points = [(-rank * step, side * rank * step) for rank, side in arms]
    elif shape == "line":
        points = [(0.0, (index - (agents - 1) / 2) * spacing) for index in range(agents)]
    else:
        raise ValueError(f"unknown shape {shape!r}; known: {', '.join(SHAPES)}")
    return np.array(points, dtype=np.float64)


def _hollow_triangle(steps: int, spacing: float) -> list[tuple[float, float]]:
    """Equilateral, ``steps`` edges a side, base at the rear, apex towards +x; apex first, then row by row."""
    height, half = spacing * math.sqrt(0.75), spacing / 2
    points = [(0.0, 0.0)]
    for row in range(1, steps):
        points += [(-row * height, -row * half), (-row * height, row * half)]
    return points + [(-steps * height, -steps * half + column * spacing) for column in range(steps + 1)]


def build_formation(points: NDArray[np.float64], spacing: float) -> Formation:
    """Root, offsets and tree of the slots at ``points`` (N, 2) metres.

    Raises:
        ValueError: two slots closer than half a spacing, or a slot that no chain of edges joins to the root.
    """
    gaps = np.linalg.norm(points[:, None] - points[None], axis=2)
    np.fill_diagonal(gaps, np.inf)
    if len(points) > 1 and gaps.min() < spacing / 2:
        first, second = (int(index) for index in np.unravel_index(gaps.argmin(), gaps.shape))
        raise ValueError(
            f"slots {first} and {second} are {gaps.min():.2f} m apart; keep slots at least {spacing / 2:.2f} m apart"
        )
    from_centroid = points - points.mean(axis=0)
    distance = np.sqrt((from_centroid * from_centroid).sum(axis=1))
    root = min(
        range(len(points)),
        key=lambda slot: (
            round(float(distance[slot]), 6),
            round(float(points[slot, 0]), 6),
            round(abs(float(from_centroid[slot, 1])), 6),
            float(points[slot, 1]),
        ),
    )
    parent = np.full(len(points), NO_PARENT, dtype=np.int16)
    reached, queue = {root}, deque([root])
    while queue:
        slot = queue.popleft()
        for other in np.flatnonzero(np.abs(gaps[slot] - spacing) < _EDGE_TOLERANCE):
            if int(other) not in reached:
                parent[other] = slot
                reached.add(int(other))
                queue.append(int(other))
    if len(reached) < len(points):
        lone = sorted(set(range(len(points))) - reached)
        raise ValueError(
            f"the slot tree is not connected: slots {lone} have no neighbour exactly {spacing:g} m away on a chain to "
            f"root slot {root}; move them to {spacing:g} m from a connected slot"
        )
    offsets = points - points[root]
    offsets.setflags(write=False)
    parent.setflags(write=False)
    return Formation(offsets, parent, root, spacing)
