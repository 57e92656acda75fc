"""Multi-hop relative positions: where a drone beyond sight is, from what neighbours say (paper, Sec. II-B1).

Each drone tells its displacements to its neighbours (one hop) and, from their last frames, to their neighbours (two
hops). Adding its own displacement to a neighbour gives at most three hops, each one tick older than the one before:

    p_{i -> l}(t) = sum_{m=0}^{d-1} p_{v_m, v_{m+1}}(t - m),      d <= hops

over a shortest path v_0 = i, ..., v_d = l of the communication graph. Among equally short paths the one through the
neighbour heard last is taken, then the one through the smallest agent number. A neighbour whose frames stopped is
believed for ``memory`` ticks: its last displacements are held.
"""

import numpy as np
from numpy.typing import NDArray

from protocols.kernels import inlined_kernel

UNKNOWN = 99  # hops to a drone that is out of reach
NEVER = -1_000_000  # tick of something that has not happened


@inlined_kernel
def chain_displacements(
    me: int,
    tick: int,
    memory: int,
    max_hops: int,
    near_count: int,
    near_id: NDArray[np.int64],
    near_rel: NDArray[np.float64],
    heard_tick: NDArray[np.int64],
    one_hop: NDArray[np.int64],
    known_count: NDArray[np.int64],
    known: NDArray[np.uint8],
    displacement: NDArray[np.float32],
    hops: NDArray[np.int64],
    rel: NDArray[np.float64],
) -> None:
    """Hops to every drone and its position relative to me.

    Args:
        near_count, near_id, near_rel: my neighbours now, displacements (K, 2) [m].
        heard_tick: (N,) tick of the last frame from each drone. one_hop, known_count, known, displacement: (N, ...) what that
            frame said, the one-hop drones first.
        hops: (N,) out. rel: (N, 2) out, that drone minus me [m]; valid where hops < UNKNOWN.
    """
    hops[:] = UNKNOWN
    hops[me], rel[me, 0], rel[me, 1] = 0, 0.0, 0.0
    for index in range(near_count):
        other = near_id[index]
        hops[other], rel[other, 0], rel[other, 1] = 1, near_rel[index, 0], near_rel[index, 1]
    for distance in range(2, max_hops + 1):
        freshest = np.full(hops.shape[0], NEVER)
        for index in range(near_count):
            via = near_id[index]
            if tick - heard_tick[via] > memory:
                continue
            first = 0 if distance == 2 else one_hop[via]
            last = one_hop[via] if distance == 2 else known_count[via]
            for entry in range(first, last):
                other = known[via, entry]
                if hops[other] < distance or heard_tick[via] <= freshest[other]:
                    continue
                freshest[other] = heard_tick[via]
                hops[other] = distance
                rel[other, 0] = near_rel[index, 0] + displacement[via, entry, 0]
                rel[other, 1] = near_rel[index, 1] + displacement[via, entry, 1]
