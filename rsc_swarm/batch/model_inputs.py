"""What a model file takes, from the recorded arrays of a batch: whole swarms taken apart into single drones."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]


class ModelInputs(NamedTuple):
    """One row per drone: own (B, L, 18), heard (B, L, K, 18), share (B, L, K), means (B, L, 18), target (B, 2), extra (B, 32)."""

    own: Array
    heard: Array
    share: Array
    means: Array
    target: Array
    extra: Array


def model_inputs(
    observation: Array, near: NDArray[np.int16], target: Array, extra: Array, past: int = 3
) -> ModelInputs:
    """Take apart observation (4, E, N, 18), near (3 or 4, E, N, K), target (E, N, 2), extra (E, N, 32): B = E N.

    What is heard at a tick are the X_j one tick older of those who were in range then; the means are those passed on until now
    (agent.relay), over L hops first.
    """
    first = len(observation) - past
    worlds, agents = target.shape[:2]
    rows = worlds * agents
    told = near[first - 1 : len(observation) - 1].astype(np.int64)
    used = told >= 0
    world = np.arange(worlds)[:, None, None]
    heard = np.stack([observation[first - 1 + step][world, told[step]] for step in range(past)])
    heard *= used[..., None]
    share = used / np.maximum(used.sum(-1, keepdims=True), 1)
    means = []
    for begin in range(past):
        mean = observation[first - 1 + begin]
        for step in range(begin, past):
            mean = (share[step][..., None] * mean[world, told[step]]).sum(-2)
        means.append(mean)
    return ModelInputs(
        own=_by_drone(observation[first:], rows),
        heard=_by_drone(heard, rows),
        share=_by_drone(share, rows),
        means=_by_drone(np.stack(means), rows),
        target=_by_drone(target[None], rows)[:, 0],
        extra=_by_drone(extra[None], rows)[:, 0],
    )


def _by_drone(values: NDArray[Any], rows: int) -> Array:
    """(L, E, N, ...) to (E N, L, ...), contiguous float32."""
    apart = values.reshape(len(values), rows, *values.shape[3:])
    return np.ascontiguousarray(np.moveaxis(apart, 0, 1), np.float32)
