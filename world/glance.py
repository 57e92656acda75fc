"""What is looked for at every tick of every world; most of the time there is nothing to be seen. One compiled look costs what two
of NumPy's would."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.kernels import kernel

OTHERS_AWAKE, WRONG_CLAIM = 1, 2


class Watch(NamedTuple):
    """What is looked at in E worlds of N drones.

    active: (E,). flying, responsive: (E, N) as world.core has them. says: (E, N) the slot each told of last. awake: (E, N) who
    was at the last look, out. sizes: (E, S) frames of each size so far, and of all above in the last place, out.
    """

    active: NDArray[np.bool_]
    flying: NDArray[np.bool_]
    responsive: NDArray[np.bool_]
    says: NDArray[np.int64]
    awake: NDArray[np.bool_]
    sizes: NDArray[np.int64]


@kernel
def glance(sent_bytes: NDArray[np.int64], claim: NDArray[np.int64], watch: Watch) -> int:
    """Count the frames that were sent, and look at what drones claim (E*N,).

    Returns:
        `OTHERS_AWAKE` if others are awake than at the last look, plus `WRONG_CLAIM` if one that flies claims a slot that it has
        not told of.
    """
    worlds, agents = watch.flying.shape
    others, wrong, largest = False, False, watch.sizes.shape[1] - 1
    for world in range(worlds):
        for agent in range(agents):
            row = world * agents + agent
            flying = watch.flying[world, agent]
            awake = watch.active[world] and flying and watch.responsive[world, agent]
            others |= awake != watch.awake[world, agent]
            watch.awake[world, agent] = awake
            wrong |= flying and claim[row] != watch.says[world, agent]
            watch.sizes[world, min(sent_bytes[row], largest)] += 1
    return OTHERS_AWAKE * others + WRONG_CLAIM * wrong


@kernel
def is_deserted(watch: Watch) -> bool:
    """Whether nobody flies any more in some active world."""
    for world in range(watch.flying.shape[0]):
        if watch.active[world]:
            found = False
            for agent in range(watch.flying.shape[1]):
                found |= watch.flying[world, agent]
            if not found:
                return True
    return False
