"""Multi-hop relative positions: where a drone beyond sight is, from what neighbours say (paper, Sec. II-B1).

Each drone tells its displacements to its neighbours (one hop) and, from their last frames, to their neighbours (two
hops). Adding its own displacement to a neighbour gives at most three hops, each one tick older than the one before:

    p_{i -> l}(t) = sum_{m=0}^{d-1} p_{v_m, v_{m+1}}(t - m),      d <= hops

over a shortest path v_0 = i, ..., v_d = l of the communication graph. Among equally short paths the one through the
neighbour heard last is taken, then the one through the smallest agent number. A neighbour whose frames stopped is
believed for ``memory`` ticks: its last displacements are held.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.kernels import inlined_kernel

MAX_HOPS = 3
UNKNOWN = 99  # hops to a drone that is out of reach
NEVER = -1_000_000  # tick of something that has not happened


class RadioRules(NamedTuple):
    """How far a frame reaches [m], for how many ticks it is believed, over how many hops one knows of others, and how fast a
    drone can be [m/s]: who says it was faster is not believed.
    """

    range_m: float
    memory_ticks: int
    max_hops: int
    speed_mps: float


class Nearby(NamedTuple):
    """The drones in sight: the first ``size`` rows of number (K,) and rel (K, 2), they minus me [m]."""

    size: int
    number: NDArray[np.int64]
    rel: NDArray[np.float64]


class Heard(NamedTuple):
    """What the last frame from each drone said, the one-hop drones first.

    tick: (N,) when it was sent. one_hop, known_count: (N,). known: (N, J) drone numbers; displacement: (N, J, 2) they minus the
    sender [m].
    """

    tick: NDArray[np.int64]
    one_hop: NDArray[np.int64]
    known_count: NDArray[np.int64]
    known: NDArray[np.uint16]
    displacement: NDArray[np.float32]


class Within(NamedTuple):
    """Whom one knows the way to. number: (N,) drone numbers, the nearest by hops first, of as many hops by rising number.
    up_to: (4,) how many of them are within 0, 1, 2, 3 hops, oneself left out."""

    number: NDArray[np.int64]
    up_to: NDArray[np.int64]


class Ways(NamedTuple):
    """hops: (N,) to every drone. rel: (N, 2) its position relative to me [m], valid where hops < UNKNOWN. within: those.
    freshest: (N,) room to work in."""

    hops: NDArray[np.int64]
    rel: NDArray[np.float64]
    freshest: NDArray[np.int64]
    within: Within


@inlined_kernel
def _put(number: NDArray[np.int64], first: int, size: int, new: int) -> int:
    """Put a number in its place among number[first:size], which rise; return how many there are then."""
    at = size
    while at > first and number[at - 1] > new:
        number[at] = number[at - 1]
        at -= 1
    number[at] = new
    return size + 1


@inlined_kernel
def chain_displacements(
    me: int,
    tick: int,
    rules: RadioRules,
    near: Nearby,
    heard: Heard,
    ways: Ways,
) -> None:
    """Find the ways to all others; ``ways`` are those found the last time, and are written."""
    hops, rel, freshest, within = ways.hops, ways.rel, ways.freshest, ways.within
    for index in range(within.up_to[-1]):
        hops[within.number[index]] = UNKNOWN
    hops[me], rel[me, 0], rel[me, 1] = 0, 0.0, 0.0
    size = 0
    for index in range(near.size):
        other = near.number[index]
        if hops[other] > 1:
            size = _put(within.number, 0, size, other)
        hops[other], rel[other, 0], rel[other, 1] = 1, near.rel[index, 0], near.rel[index, 1]
    within.up_to[1] = size
    for distance in range(2, within.up_to.shape[0]):
        if distance > rules.max_hops:
            within.up_to[distance] = size
            continue
        for index in range(near.size):
            via = near.number[index]
            if tick - heard.tick[via] > rules.memory_ticks:
                continue
            first = 0 if distance == 2 else heard.one_hop[via]
            last = heard.one_hop[via] if distance == 2 else heard.known_count[via]
            for entry in range(first, last):
                other = int(np.int64(heard.known[via, entry]))
                if hops[other] < distance or (hops[other] == distance and heard.tick[via] <= freshest[other]):
                    continue
                if hops[other] == UNKNOWN:
                    size = _put(within.number, within.up_to[distance - 1], size, other)
                freshest[other] = heard.tick[via]
                hops[other] = distance
                rel[other, 0] = near.rel[index, 0] + heard.displacement[via, entry, 0]
                rel[other, 1] = near.rel[index, 1] + heard.displacement[via, entry, 1]
        within.up_to[distance] = size
