"""The learned half of an epoch: mini-batches of graphs, the loss, the weights and their running average."""

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from rsc_swarm.training.config import TrainingConfig
from rsc_swarm.training.network import PolicyNetwork
from rsc_swarm.training.replay import Replay, Samples, mirrored


@dataclass(frozen=True)
class Learned:
    """Means over an epoch's updates."""

    loss: float
    mae_m: float
    learning_rate: float  # at the end


class Learner:
    """A network that learns, and the average of its weights, which is what flies."""

    def __init__(self, config: TrainingConfig, network: PolicyNetwork) -> None:
        self.config, self.network = config, network
        self.average = copy.deepcopy(network).eval().requires_grad_(False)
        self.updates = 0
        self._device = network.device
        self._optimizer = torch.optim.AdamW(
            network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay, fused=True
        )
        self._half = config.bfloat16 and _multiplies_bfloat16(self._device)

    def measure(self, samples: Samples) -> None:
        """Take the normalisation of the inputs from recorded data; before the first update."""
        for network in (self.network, self.average):
            network.normal_x.measure(samples.observation)
            network.normal_local.measure(samples.local)

    def learn(self, replay: Replay, each_update: Callable[[], None]) -> Learned:
        """One epoch's updates; torch's seed decides which graphs."""
        config, sums = self.config, torch.zeros(2, device=self._device)
        self.network.train()
        for _ in range(config.updates):
            samples = replay.take(torch.randint(len(replay), (config.batch,)))
            if config.mirror:
                samples = mirrored(samples, (torch.rand(config.batch) < 0.5).to(self._device))
            loss, error = self._errors(samples)
            self._optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), config.clip)
            for group in self._optimizer.param_groups:
                group["lr"] = self._rate()
            self._optimizer.step()
            self.updates += 1
            self._average()
            sums += torch.stack([loss.detach(), error])
            each_update()
        self.network.eval()
        loss_mean, error_mean = (sums / config.updates).tolist()
        return Learned(loss_mean, error_mean, self._rate())

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

    def _rate(self) -> float:
        """The learning rate now."""
        config = self.config
        if not config.cosine:
            return config.learning_rate
        return (
            0.5
            * config.learning_rate
            * (1 + math.cos(math.pi * self.updates / (config.epochs * config.updates)))
        )

    @torch.no_grad()
    def _average(self) -> None:
        # The first weights are forgotten faster: they are worth nothing.
        keep = min(self.config.averaging, (1 + self.updates) / (10 + self.updates))
        for mean, weight in zip(self.average.parameters(), self.network.parameters(), strict=True):
            mean.lerp_(weight, 1 - keep)

    def state(self) -> dict[str, Any]:
        """Everything that learning goes on from."""
        return {
            "updates": self.updates,
            "network": self.network.state_dict(),
            "average": self.average.state_dict(),
            "optimizer": self._optimizer.state_dict(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from `state`."""
        self.updates = state["updates"]
        self.network.load_state_dict(state["network"])
        self.average.load_state_dict(state["average"])
        self._optimizer.load_state_dict(state["optimizer"])


def penalty(error: Tensor, limit: float | None) -> Tensor:
    """Mean square of errors; beyond ``limit`` along the tangent, so that few wild states do not decide everything (Huber)."""
    if limit is None:
        return error.square().mean()
    return 2 * torch.nn.functional.huber_loss(error, torch.zeros_like(error), delta=limit)


def _multiplies_bfloat16(device: torch.device) -> bool:
    """Whether bfloat16 is faster than float32 there; on a CPU without the instructions it is much slower."""
    if device.type == "cuda":
        return torch.cuda.is_bf16_supported()
    return bool(torch.cpu.get_capabilities().get("avx512_bf16", False))
