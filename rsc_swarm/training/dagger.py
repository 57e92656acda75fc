"""DAgger (paper, Sec. III-A; Ross et al. 2011): fly with the policy, label with the expert, learn from all so far.

An epoch is a flown half and a learned half. All its chance comes from (seed, epoch), and every epoch begins with fresh
episodes; so a training that was stopped goes on from the last whole epoch to the same weights.
"""

import os
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from torch.utils.tensorboard import SummaryWriter

from agent.policy.model_file import note_of
from rsc_swarm.batch.model_inputs import ModelInputs, model_inputs
from rsc_swarm.training.checkpoint import TrainingFolder
from rsc_swarm.training.config import TrainingConfig, TrainingError
from rsc_swarm.training.export import export
from rsc_swarm.training.flying import fly
from rsc_swarm.training.learning import Learner
from rsc_swarm.training.network import TARGET_SIZE, make_network
from rsc_swarm.training.replay import Replay
from rsc_swarm.training.watcher import Scalars, Watcher

_RECORDED = 40  # graphs on which the exported model is checked


def train(config: TrainingConfig, path: Path, device: str, threads: int | None, watcher: Watcher) -> Path:
    """Train, or go on with the training in the folder ``path``; return the model file.

    Args:
        device: auto, cpu or cuda. threads: of torch; one per processor if not given.

    Raises:
        TrainingError: no such device, or as TrainingFolder and export.
    """
    torch.set_num_threads(threads or len(os.sched_getaffinity(0)))
    place = _device(device)
    folder = TrainingFolder(path, config)
    state = folder.load()
    curve: list[Scalars] = state["curve"] if state else []
    watcher.begin(config, curve)
    if len(curve) == config.epochs and folder.model.exists() and note_of(folder.model).exists():
        return folder.model
    _seed(config, 0)
    learner, replay = Learner(config, make_network(config).to(place)), Replay(config, place)
    if state:
        learner.restore(state["learner"])
        folder.refill(replay, len(curve))
    with SummaryWriter(str(path), purge_step=len(curve)) as board:
        for epoch in range(len(curve), config.epochs):
            scalars = _epoch(config, epoch, learner, replay, watcher)
            curve = [*curve, scalars]
            folder.save(curve, learner.state(), replay)
            for name, value in scalars.items():
                board.add_scalar(name, value, epoch)
            watcher.epoch(scalars)
    export(learner.average, config, _recorded(config, replay), folder.model)
    folder.finish()
    return folder.model


def _device(wanted: str) -> torch.device:
    if wanted not in ("auto", "cpu", "cuda"):
        raise TrainingError(f"--device {wanted}: give auto, cpu or cuda")
    if wanted == "cuda" and not torch.cuda.is_available():
        raise TrainingError("--device cuda: torch finds no GPU here; give cpu or auto")
    return torch.device("cuda" if wanted != "cpu" and torch.cuda.is_available() else "cpu")


def _recorded(config: TrainingConfig, replay: Replay) -> ModelInputs:
    """What single drones would have heard in the first graphs of the replay."""
    samples = replay.take(torch.arange(min(_RECORDED, len(replay))))
    observation, near, local = (values.cpu().numpy() for values in samples[:3])
    target, extra = local[..., :TARGET_SIZE], local[..., TARGET_SIZE:]
    return model_inputs(observation.swapaxes(0, 1), near.swapaxes(0, 1), target, extra, config.past)


def mixing(config: TrainingConfig, epoch: int) -> float:
    """The share of plans that the expert flies in an epoch: falls in a straight line, then stays."""
    first, last = config.mixing
    return max(0.0, 1 - epoch / max(1, round(config.mixing_share * config.epochs))) * (first - last) + last


def _epoch(config: TrainingConfig, epoch: int, learner: Learner, replay: Replay, watcher: Watcher) -> Scalars:
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
