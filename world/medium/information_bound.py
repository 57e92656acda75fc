"""What the radio allowed: how far news could have come if every frame had told all that its sender knew.

It looks at the frames that were really delivered, so no way of telling can be faster. world.invariants holds the drones'
gossip against it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.kernels import kernel

NEVER = -1


class InformationBound(NamedTuple):
    """latest: (E, N, N) the last tick of drone j of which drone i could know. told: (E, D, N, N) the same when it last sent at
    tick % D."""

    latest: NDArray[np.int32]
    told: NDArray[np.int32]


def empty_information_bound(worlds: int, agents: int, ring: int) -> InformationBound:
    """Nobody knows of anybody; frames take less than ``ring`` ticks."""
    return InformationBound(
        np.full((worlds, agents, agents), NEVER, np.int32),
        np.full((worlds, ring, agents, agents), NEVER, np.int32),
    )


@kernel
def spread(
    information_bound: InformationBound,
    ticks: NDArray[np.int64],
    active: NDArray[np.bool_],
    start: NDArray[np.int64],
    arrived: NDArray[np.int32],
) -> None:
    """One tick: all hear what arrives now, as world.medium.medium.deliver gives it; then each knows of itself up to now."""
    worlds, agents = information_bound.latest.shape[:2]
    ring = information_bound.told.shape[1]
    for world in range(worlds):
        if not active[world]:
            continue
        latest, tick = information_bound.latest[world], ticks[world]
        for agent in range(agents):
            row = world * agents + agent
            for place in range(start[row], start[row + 1]):
                source, sent = arrived[place, 0] - world * agents, arrived[place, 1] % ring
                for other in range(agents):
                    known = information_bound.told[world, sent, source, other]
                    latest[agent, other] = max(latest[agent, other], known)
            latest[agent, agent] = tick
        told = information_bound.told[world, tick % ring]
        for agent in range(agents):
            for other in range(agents):
                told[agent, other] = latest[agent, other]
