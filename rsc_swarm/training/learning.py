"""The learned half of an epoch: mini-batches of graphs, the loss, the weights and their running average."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import torch
from torch import Tensor
from torch.optim.lr_scheduler import ConstantLR, CosineAnnealingLR
from torch.optim.swa_utils import AveragedModel

from rsc_swarm.training.config import TrainingConfig
from rsc_swarm.training.network import PolicyNetwork
from rsc_swarm.training.replay import Replay, Samples, mirrored


@dataclass(frozen=True)
class Learned:
    """Means over an epoch's updates."""

    loss: float
    mae_m: float
    learning_rate: float  # at the end


class Half(NamedTuple):
    """How far an epoch's updates are: how many are done, the sums of their loss and error (2,), and torch's chance since."""

    done: int
    sums: Tensor
    chance: Tensor


class Learner:
    """A network that learns, and the average of its weights, which is what flies."""

    def __init__(self, config: TrainingConfig, network: PolicyNetwork) -> None:
        self.config, self.network = config, network
        self._averaged = AveragedModel(network, avg_fn=self._averaged_weight).eval().requires_grad_(False)
        self.updates = 0
        self._device = network.device
        self._optimizer = torch.optim.AdamW(
            network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay, fused=True
        )
        self._schedule = (
            CosineAnnealingLR(self._optimizer, T_max=config.epochs * config.updates)
            if config.cosine
            else ConstantLR(self._optimizer, factor=1.0)
        )
        self._half = config.bfloat16 and _multiplies_bfloat16(self._device)

    @property
    def average(self) -> PolicyNetwork:
        """The network with the averaged weights."""
        return cast(PolicyNetwork, self._averaged.module)

    def measure(self, samples: Samples) -> None:
        """Take the normalisation of the inputs from recorded data; before the first update."""
        for network in (self.network, self.average):
            network.normal_x.measure(samples.observation)
            network.normal_local.measure(samples.local)

    def learn(
        self, replay: Replay, each_update: Callable[[int, Tensor], None], half: Half | None = None
    ) -> Learned:
        """One epoch's updates, or those that ``half`` leaves; torch's seed decides which graphs. ``each_update`` is told how many
        are done, and the sums of their loss and error."""
        config, sums = self.config, torch.zeros(2, device=self._device)
        done = 0
        if half:
            done, sums = half.done, half.sums.to(self._device)
            torch.set_rng_state(half.chance)
        self.network.train()
        for place in range(done, config.updates):
            samples = replay.take(torch.randint(len(replay), (config.batch,)))
            if config.mirror:
                samples = mirrored(samples, (torch.rand(config.batch) < 0.5).to(self._device))
            loss, error = self._errors(samples)
            self._optimizer.zero_grad()
            torch.autograd.backward(loss)
            if config.clip is not None:
                torch.nn.utils.clip_grad_norm_(self.network.parameters(), config.clip)
            self._optimizer.step()
            self._schedule.step()
            self.updates += 1
            self._averaged.update_parameters(self.network)
            sums += torch.stack([loss.detach(), error])
            each_update(place + 1, sums)
        self.network.eval()
        loss_mean, error_mean = (sums / config.updates).tolist()
        return Learned(loss_mean, error_mean, float(self._schedule.get_last_lr()[0]))

    @torch.no_grad()
    def error_m(self, samples: Samples) -> float:
        """Mean |dr| [m] of what flies, over all samples, steps and axes."""
        network = self.average
        off = []
        for first in range(0, len(samples.local), self.config.batch):
            part = Samples(
                *(values[first : first + self.config.batch].to(self._device) for values in samples)
            )
            planned, _, _ = network.plan(network.graphs(*part[:3]))
            off.append((planned - network.plan.travelled(part.change)).abs().mean((1, 2, 3)))
        return float(torch.cat(off).mean())

    def _errors(self, samples: Samples) -> tuple[Tensor, Tensor]:
        """The loss of (dr) / (T²/3) and (dv) / T [m/s²], weighted, and the mean |dr| [m] over samples, steps and axes."""
        plan, config = self.network.plan, self.config
        with torch.autocast(self._device.type, torch.bfloat16, enabled=self._half):
            output = self.network.graphs(*samples[:3])
        displacement, change, _ = plan(output.float())
        off = displacement - plan.travelled(samples.change)
        loss = config.position_weight * penalty(off / plan.scale_m, config.outlier_mps2)
        if config.velocity_weight:
            off_speed = (change - samples.change) / config.duration_s
            loss = loss + config.velocity_weight * penalty(off_speed, config.outlier_mps2)
        return loss, off.detach().abs().mean()

    def _averaged_weight(self, mean: Tensor, weight: Tensor, averaged: Tensor | int) -> Tensor:
        """The average after one more of so many weights; the first ones are worth nothing and forgotten faster."""
        keep = min(self.config.averaging, (2 + int(averaged)) / (11 + int(averaged)))
        return mean.lerp(weight, 1 - keep)

    def state(self) -> dict[str, Any]:
        """Everything that learning goes on from."""
        return {
            "updates": self.updates,
            "network": self.network.state_dict(),
            "average": self._averaged.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "schedule": self._schedule.state_dict(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from `state`."""
        self.updates = state["updates"]
        self.network.load_state_dict(state["network"])
        self._averaged.load_state_dict(state["average"])
        self._optimizer.load_state_dict(state["optimizer"])
        self._schedule.load_state_dict(state["schedule"])


def penalty(error: Tensor, limit: float | None) -> Tensor:
    """Mean square of errors; beyond ``limit`` along the tangent, so that few wild states do not decide everything (Huber)."""
    if limit is None:
        return error.square().mean()
    return 2 * torch.nn.functional.huber_loss(error, torch.zeros_like(error), delta=limit)


def _multiplies_bfloat16(device: torch.device) -> bool:
    """Whether bfloat16 is faster than float32 there; on a CPU without the instructions it is much slower."""
    if device.type == "cuda":
        return bool(torch.cuda.is_bf16_supported())
    return bool(torch.cpu.get_capabilities().get("avx512_bf16", False))
