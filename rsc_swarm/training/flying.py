"""The flown half of an epoch: episodes in step, by the policy or the expert, every state labelled by the expert.

An epoch is flown in parts; a part is a function of what it is and of the policy, wherever it is flown.

The expert flies on from a snapshot of each state, which is then restored; so its label is what it would do there,
wherever the policy has brought the swarm (DAgger, Ross et al. 2011).
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from protocols.dynamics import TICK_S
from protocols.mission.document import Mission
from protocols.mission.fields import Obstacles, Trajectory
from rsc_swarm.batch.batch import Batch
from rsc_swarm.batch.stage import COLLIDED, FLYING, SUCCEEDED
from rsc_swarm.options import MissionOptions, resolve
from rsc_swarm.training.config import PAST, TrainingConfig
from rsc_swarm.training.network import PolicyNetwork
from rsc_swarm.training.replay import Replay, Samples

TRAINING_MAPS = (1_000_000, 2**32)
_VALIDATION = 900_000  # the first of the maps for that
_VALIDATED_EVERY = 100  # ticks
_PLAIN, _HARD = Obstacles(), Obstacles(count=(12, 14))


@dataclass
class Flown:
    """What flights add up to. errors_m: of the policy's plans, before it learned from these flights, a mean a round; moved_m: the
    same of flying on as now."""

    episodes: int = 0
    succeeded: int = 0
    collided: int = 0
    errors_m: list[np.floating[Any]] = field(default_factory=list)
    moved_m: list[np.floating[Any]] = field(default_factory=list)

    def add(self, other: "Flown") -> None:
        """Count another's too."""
        self.episodes += other.episodes
        self.succeeded += other.succeeded
        self.collided += other.collided
        self.errors_m += other.errors_m
        self.moved_m += other.moved_m


@dataclass(frozen=True)
class Part:
    """One of the parts in which the episodes of an epoch are flown. mixing: the share of plans that the expert flies."""

    config: TrainingConfig
    epoch: int
    number: int
    mixing: float

    @property
    def worlds(self) -> int:
        """How many episodes it flies in step."""
        return len(range(self.number, self.config.worlds, self.config.parts))

    @property
    def graphs(self) -> int:
        """How many it adds to a replay."""
        return self.worlds * self.config.plans


def seeded(config: TrainingConfig, *place: int) -> np.random.Generator:
    """Begin a part of the training: all chance in it, torch's too, comes from here."""
    rng = np.random.default_rng([config.seed, *place])
    torch.manual_seed(int(rng.integers(2**62)))
    return rng


@cache
def _as_in_the_paper() -> Mission:
    return resolve(MissionOptions(mission="paper"))


def training_mission(config: TrainingConfig, rng: np.random.Generator, detour: bool) -> Mission:
    """A mission on a map that no test uses, from a start of its own."""
    maps = TRAINING_MAPS if config.maps is None else (TRAINING_MAPS[0], TRAINING_MAPS[0] + config.maps)
    if config.flown == "paper":
        seeds = {"map_seed": int(rng.integers(*maps)), "seed": int(rng.integers(2**32))}
        return _as_in_the_paper().model_copy(update={"agents": config.agents, **seeds})
    return Mission(
        name="training",
        agents=config.agents,
        obstacles=_HARD if rng.random() < config.hard_share else _PLAIN,
        trajectory=Trajectory(tracking="required" if config.output == "raw" else "smooth"),
        detour=detour,
        map_seed=int(rng.integers(*maps)),
        seed=int(rng.integers(2**32)),
    )


def fly(part: Part, policy: PolicyNetwork, replay: Replay, each_round: Callable[[], None]) -> Flown:
    """Fly the rounds of one part of an epoch and add all graphs to the replay."""
    config, worlds = part.config, part.worlds
    rng = seeded(config, part.epoch + 1, *([part.number] if part.number else []))
    detour = bool(rng.random() < config.detour_share)
    missions = [training_mission(config, rng, detour) for _ in range(worlds)]
    batch = Batch(missions, papers=config.expert == "paper")
    flown = Flown()
    for _ in range(config.plans):
        displacement, change = batch.label(config.horizon)
        samples = observed(batch, config, torch.from_numpy(change))
        replay.add(samples)
        flown.moved_m.append(np.abs(displacement).mean())
        by_expert = rng.random(worlds) < part.mixing
        ticks = int(rng.integers(config.fly_ticks[0], config.fly_ticks[1] + 1))
        if by_expert.all():
            batch.fly(ticks)
        else:
            planned, acceleration = decide(policy, samples)
            flown.errors_m.append(np.abs(planned - displacement).mean())
            planned, acceleration = continued(planned, acceleration, ticks)
            batch.fly(ticks, acceleration, planned, by_expert)
        for world in np.flatnonzero(batch.stage.result != FLYING):
            flown.episodes += 1
            flown.succeeded += int(batch.stage.result[world] == SUCCEEDED)
            flown.collided += int(batch.stage.result[world] == COLLIDED)
            batch.restart(int(world), training_mission(config, rng, detour))
        each_round()
    return flown


def validation(config: TrainingConfig) -> Samples | None:
    """Graphs from fields that nothing is learned from, flown and labelled by the expert; None if none are asked for."""
    if not config.validation_maps:
        return None
    rng = np.random.default_rng([config.seed, _VALIDATION])
    missions = [
        training_mission(config, rng, detour=False).model_copy(update={"map_seed": _VALIDATION + place})
        for place in range(config.validation_maps)
    ]
    batch = Batch(missions, papers=config.expert == "paper")
    graphs = []
    while (flying := batch.stage.result == FLYING).any():
        _, change = batch.label(config.horizon)
        seen = observed(batch, config, torch.from_numpy(change))
        graphs.append([values[torch.from_numpy(flying)].clone() for values in seen])
        batch.fly(_VALIDATED_EVERY)
    return Samples(*(torch.cat(values) for values in zip(*graphs, strict=True)))


def observed(batch: Batch, config: TrainingConfig, change: Tensor) -> Samples:
    """What the drones of all worlds see now, with the expert's label."""
    local = [batch.stage.target, batch.stage.extra] if config.extra == "wide" else [batch.stage.target]
    return Samples(
        torch.from_numpy(batch.stage.observation).transpose(0, 1),
        torch.from_numpy(batch.stage.near[:PAST]).transpose(0, 1),
        torch.from_numpy(np.concatenate(local, -1)),
        change,
    )


@torch.no_grad()
def decide(policy: PolicyNetwork, samples: Samples) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The policy's plan for whole swarms: displacement and acceleration, (E, N, H, 2) each."""
    output = policy.graphs(*(values.to(policy.device) for values in samples[:3]))
    displacement, _, acceleration = policy.plan(output)
    return displacement.cpu().numpy(), acceleration.cpu().numpy()


def continued(
    displacement: NDArray[np.float32], acceleration: NDArray[np.float32], ticks: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Plans (..., H, 2) for so many ticks: those beyond the horizon go on with the last acceleration."""
    horizon = displacement.shape[-2]
    if ticks <= horizon:
        return displacement, acceleration
    last, final = acceleration[..., -1:, :], displacement[..., -1:, :]
    before = displacement[..., -2:-1, :] if horizon > 1 else 0.0 * final
    speed = (final - before) / TICK_S + 0.5 * TICK_S * last
    later = TICK_S * np.arange(1, ticks - horizon + 1, dtype=np.float32)[:, None]
    beyond = final + speed * later + 0.5 * last * later**2
    steady = np.broadcast_to(last, beyond.shape)
    return np.concatenate([displacement, beyond], -2), np.concatenate([acceleration, steady], -2)
