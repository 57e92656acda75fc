"""DAgger (paper, Sec. III-A; Ross et al. 2011): fly with the policy, label with the expert, learn from all so far.

An epoch is a flown half and a learned half. All its chance comes from (seed, epoch), and every epoch begins with fresh
episodes; so a training that was stopped goes on from the last whole epoch to the same weights.
"""

import time
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from torch.utils.tensorboard import SummaryWriter

from rsc_swarm.model_inputs import model_inputs
from rsc_swarm.training.checkpoint import TrainingFolder
from rsc_swarm.training.config import TrainingConfig
from rsc_swarm.training.export import export
from rsc_swarm.training.flying import fly
from rsc_swarm.training.learning import Learner
from rsc_swarm.training.network import make_network
from rsc_swarm.training.replay import Replay

_RECORDED = 40  # graphs on which the exported model is checked


class Watcher:
    """Is told how the training goes."""

    def begin(self, config: TrainingConfig, epochs: int) -> None:
        """It begins, or goes on after so many epochs."""

    def step(self, share: float) -> None:
        """More of the present epoch is done, in all this share."""

    def epoch(self, scalars: dict[str, float]) -> None:
        """An epoch is done."""


def train(config: TrainingConfig, path: Path, device: torch.device, watcher: Watcher) -> Path:
    """Train, or go on with the training in the folder ``path``; return the model file.

    Raises:
        rsc_swarm.training.config.TrainingError: as TrainingFolder and export.
    """
    folder = TrainingFolder(path, config)
    state = folder.load()
    _seed(config, 0)
    learner = Learner(config, make_network(config).to(device))
    replay = Replay(config, device)
    curve: list[dict[str, float]] = []
    if state:
        if state["epochs"] == config.epochs and folder.model.exists():
            return folder.model
        learner.restore(state["learner"])
        folder.refill(replay, state["epochs"])
        curve = state["curve"]
    watcher.begin(config, len(curve))
    with SummaryWriter(str(path), purge_step=len(curve)) as board:
        for epoch in range(len(curve), config.epochs):
            curve.append(_epoch(config, epoch, learner, replay, watcher))
            per_epoch = config.worlds * config.rounds
            folder.save(epoch, learner.state(), curve, replay.newest(min(per_epoch, replay.capacity)))
            folder.forget(epoch - replay.capacity // per_epoch - 1)
            for name, value in curve[-1].items():
                board.add_scalar(name, value, epoch)
            watcher.epoch(curve[-1])
    samples = replay.take(torch.arange(min(_RECORDED, len(replay))))
    observation, near, local = (values.cpu().numpy() for values in samples[:3])
    recorded = model_inputs(
        observation.swapaxes(0, 1), near.swapaxes(0, 1), local[..., :2], local[..., 2:], config.past
    )
    export(learner.average, config, recorded, folder.model)
    folder.finish()
    return folder.model


def mixing(config: TrainingConfig, epoch: int) -> float:
    """The share of plans that the expert flies in an epoch: falls in a straight line, then stays."""
    first, last = config.mixing
    return max(0.0, 1 - epoch / max(1, round(config.mixing_share * config.epochs))) * (first - last) + last


def _epoch(
    config: TrainingConfig, epoch: int, learner: Learner, replay: Replay, watcher: Watcher
) -> dict[str, float]:
    """Fly and learn; the scalars of the curve."""
    rng = _seed(config, epoch + 1)
    steps, done, begin = config.rounds + config.updates, 0, time.monotonic()

    def step() -> None:
        nonlocal done
        done += 1
        watcher.step(done / steps)

    flown = fly(config, learner.average, mixing(config, epoch), rng, replay, step)
    flown_s = time.monotonic() - begin
    if epoch == 0:
        learner.measure(replay.take(torch.arange(len(replay))))
    learned = learner.learn(replay, step)
    scalars = {
        "epoch": epoch,
        "updates": learner.updates,
        "graphs": replay.total,
        "mixing": mixing(config, epoch),
        "flown_s": flown_s,
        "learned_s": time.monotonic() - begin - flown_s,
        **asdict(learned),
        "episodes": flown.episodes,
        "flown_mae_constant_velocity_m": flown.mae_constant_velocity_m,
    }
    if flown.mae_m is not None:
        scalars["flown_mae_m"] = flown.mae_m
    if flown.episodes:
        scalars["success"] = flown.succeeded / flown.episodes
        scalars["collision"] = flown.collided / flown.episodes
    return scalars


def _seed(config: TrainingConfig, part: int) -> np.random.Generator:
    """Begin a part of the training: all chance in it comes from here."""
    rng = np.random.default_rng([config.seed, part])
    torch.manual_seed(int(rng.integers(2**62)))
    return rng
