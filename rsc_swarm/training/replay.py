"""The replay buffer: all graphs flown so far, in arrays of fixed size, the oldest overwritten first."""

from typing import NamedTuple

import torch
from torch import Tensor

from agent.observation import WIDE_SIZE
from protocols.wire.frames import OBSERVATION_SIZE
from rsc_swarm.batch.batch import NEIGHBOURS
from rsc_swarm.training.config import PAST, TrainingConfig
from rsc_swarm.training.network import TARGET_SIZE

# Signs under a mirror along the direction of motion: every y changes its sign.
_MIRROR_X = [1, -1] * 2 + [1, -1, 1] * 2 + [1, -1] * 4
_MIRROR_LOCAL = [1, -1] + [1, -1, 1] * 4 + [1, -1] * ((WIDE_SIZE - 12) // 2)


class Samples(NamedTuple):
    """Graphs of N drones: observation (G, 4, N, 18), near (G, 3, N, K), local (G, N, F), and the label: the expert's
    velocity change (G, N, H, 2) [m/s] after each step, from which its displacements follow."""

    observation: Tensor
    near: Tensor
    local: Tensor
    change: Tensor


def mirrored(samples: Samples, flip: Tensor) -> Samples:
    """The samples, those with ``flip`` (G,) as seen in a mirror."""

    def seen(values: Tensor, signs: list[int]) -> Tensor:
        sign = torch.tensor(signs, dtype=values.dtype, device=values.device)
        chosen = flip.view(-1, *[1] * (values.dim() - 1))
        return torch.where(chosen, values * sign, values)

    return Samples(
        seen(samples.observation, _MIRROR_X),
        samples.near,
        seen(samples.local, _MIRROR_LOCAL[: samples.local.shape[-1]]),
        seen(samples.change, [1, -1]),
    )


class Replay:
    """Graphs in half precision on one device: what is learned from is noisier than that."""

    def __init__(self, config: TrainingConfig, device: torch.device, capacity: int | None = None) -> None:
        """``capacity``: graphs; the config's, if not given."""
        drones, local = config.agents, TARGET_SIZE + (WIDE_SIZE if config.extra == "wide" else 0)
        self.capacity = capacity or min(config.replay, config.epochs * config.plans * config.worlds)

        def room(kind: torch.dtype, *shape: int) -> Tensor:
            return torch.empty(self.capacity, *shape, dtype=kind, device=device)

        self._rows = Samples(
            room(torch.float16, PAST + 1, drones, OBSERVATION_SIZE),
            room(torch.int16, PAST, drones, NEIGHBOURS),
            room(torch.float16, drones, local),
            room(torch.float16, drones, config.horizon, 2),
        )
        self.total = 0  # graphs ever added

    def __len__(self) -> int:
        return min(self.total, self.capacity)

    def add(self, samples: Samples) -> None:
        """Keep more graphs."""
        count = len(samples.local)
        place = (self.total + torch.arange(count)) % self.capacity
        for kept, new in zip(self._rows, samples, strict=True):
            kept[place] = new.to(kept)
        self.total += count

    def take(self, index: Tensor) -> Samples:
        """The graphs in these rows, as float32."""
        observation, near, local, change = (kept[index] for kept in self._rows)
        return Samples(observation.float(), near, local.float(), change.float())

    def newest(self, count: int) -> Samples:
        """The graphs added last, as they are kept."""
        place = torch.arange(self.total - count, self.total) % self.capacity
        return Samples(*(kept[place] for kept in self._rows))
