"""DAgger (paper, Sec. III-A; Ross et al. 2011): fly with the policy, label with the expert, learn from all so far.

An epoch is a flown half and a learned half. All its chance comes from (seed, epoch), and every epoch begins with fresh
episodes; what was flown is kept at once, and what was learned every minute. So a training that was stopped goes on from there
to the same weights.
"""

import math
import os
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from agent.policy.model_file import note_of
from rsc_swarm.batch.model_inputs import ModelInputs, model_inputs
from rsc_swarm.training.board import Board
from rsc_swarm.training.checkpoint import TrainingFolder
from rsc_swarm.training.config import TrainingConfig, TrainingError
from rsc_swarm.training.elsewhere import fly_elsewhere
from rsc_swarm.training.export import export
from rsc_swarm.training.flying import Flown, Part, fly, seeded, validation
from rsc_swarm.training.learning import Half, Learner
from rsc_swarm.training.network import TARGET_SIZE, make_network
from rsc_swarm.training.replay import Replay
from rsc_swarm.training.watcher import Scalars, Watcher

_RECORDED = 40  # graphs on which the exported model is checked
_SAVE_EVERY_S = 60.0
_LEAST_EPOCHS = 10  # before anything is called a plateau


def train(
    config: TrainingConfig,
    path: Path,
    device: str,
    threads: int | None,
    watcher: Watcher,
    executor: Executor | None = None,
) -> Path:
    """Train, or go on with the training in the folder ``path``; return the model file.

    Args:
        device: auto, cpu or cuda. threads: of torch; one per processor if not given. executor: its workers fly, instead of this
            process; the model is the same.

    Raises:
        TrainingError: no such device, or as TrainingFolder and export. rsc_swarm.study.workers.WorkerError: a worker broke.
    """
    torch.set_num_threads(threads or len(os.sched_getaffinity(0)))
    folder = TrainingFolder(path, config)
    with folder.alone():
        return _train(config, folder, _device(device), watcher, executor)


def _train(
    config: TrainingConfig,
    folder: TrainingFolder,
    place: torch.device,
    watcher: Watcher,
    executor: Executor | None,
) -> Path:
    state = folder.load()
    curve: list[Scalars] = state["curve"] if state else []
    watcher.begin(config, curve)
    over = len(curve) == config.epochs or (config.plateau and on_plateau(config, curve))
    if over and folder.model.exists() and note_of(folder.model).exists():
        return folder.model
    seeded(config, 0)
    learner, replay = Learner(config, make_network(config).to(place)), Replay(config, place)
    within = folder.load_within(len(curve))
    if state:
        learner.restore(state["learner"])
    folder.refill(replay, len(curve) + bool(within))
    held_out = validation(config)
    with Board(folder.path, len(curve)) as board:
        while len(curve) < config.epochs and not (config.plateau and on_plateau(config, curve)):
            epoch = _Epoch(config, curve, learner, replay, folder, watcher, executor)
            scalars = epoch.run(within)
            within = None
            if held_out:
                scalars["validation_mae_m"] = learner.error_m(held_out)
            curve = [*curve, scalars]
            folder.save(curve, learner.state(), replay)
            board.add(len(curve) - 1, scalars)
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


def mixing(config: TrainingConfig, epoch: int, episodes: float = 0) -> float:
    """The share of plans that the expert flies in an epoch before which so many episodes were flown: it falls in a straight line
    or as in the paper, then stays."""
    first, last = config.mixing
    if config.mixing_rule == "paper":
        return max(first * math.pow(0.99, max(episodes - 1000, 0)), last)
    return max(0.0, 1 - epoch / max(1, round(config.mixing_share * config.epochs))) * (first - last) + last


def on_plateau(config: TrainingConfig, curve: Sequence[Scalars]) -> bool:
    """Whether the validation error got better by less than 1 % in the last fifth of the epochs in which the policy had its full
    share."""
    errors = [point["validation_mae_m"] for point in curve if point["mixing"] <= config.mixing[1]]
    last = len(errors) // 5
    return len(errors) >= _LEAST_EPOCHS and min(errors[-last:]) > 0.99 * min(errors[:-last])


class _Epoch:
    """One epoch of a training: fly and learn."""

    def __init__(
        self, config: TrainingConfig, curve: Sequence[Scalars], learner: Learner, replay: Replay,
        folder: TrainingFolder, watcher: Watcher, executor: Executor | None,
    ) -> None:  # fmt: skip
        self._config, self._number, self._learner, self._replay = config, len(curve), learner, replay
        self._folder, self._watcher, self._executor = folder, watcher, executor
        self._mixing = mixing(config, self._number, sum(point["episodes"] for point in curve))
        self._saved_at = time.monotonic()

    def run(self, within: dict[str, Any] | None) -> Scalars:
        """Fly and learn, or go on with what was saved amid this epoch; the scalars of the curve."""
        if within:
            flown, half = within["flown"], Half(within["done"], within["sums"], within["chance"])
            self._learner.restore(within["learner"])
        else:
            flown, half = self._fly(), None
        begin = time.monotonic()

        def each_update(done: int, sums: Tensor) -> None:
            if time.monotonic() - self._saved_at >= _SAVE_EVERY_S and done < self._config.updates:
                self._save(flown, Half(done, sums, torch.get_rng_state()))
            self._watcher.step(self._share(self._config.plans + done))

        learned = self._learner.learn(self._replay, each_update, half)
        return {
            **flown,
            "updates": self._learner.updates,
            "learned_s": time.monotonic() - begin,
            **asdict(learned),
        }

    def _fly(self) -> Scalars:
        config, begin = self._config, time.monotonic()
        flown = self._fly_parts()
        seeded(config, self._number + 1)  # for what is learned from them, whoever has flown
        if self._number == 0:
            self._learner.measure(self._replay.take(torch.arange(len(self._replay))))
        scalars = {
            "epoch": self._number,
            "graphs": self._replay.total,
            "mixing": self._mixing,
            "flown_s": time.monotonic() - begin,
            "episodes": flown.episodes,
            "flown_mae_constant_velocity_m": float(np.mean(flown.moved_m)),
        }
        if flown.errors_m:
            scalars["flown_mae_m"] = float(np.mean(flown.errors_m))
        if flown.episodes:
            scalars["success"] = flown.succeeded / flown.episodes
            scalars["collision"] = flown.collided / flown.episodes
        self._folder.save_flown(self._number, self._replay)
        nothing = Half(0, torch.zeros(2), torch.get_rng_state())
        self._save(scalars, nothing)
        return scalars

    def _fly_parts(self) -> Flown:
        config, policy, done = self._config, self._learner.average, 0

        def step(rounds: int = 1) -> None:
            nonlocal done
            done += rounds
            self._watcher.step(self._share(done / config.parts))

        parts = [Part(config, self._number, number, self._mixing) for number in range(config.parts)]
        if self._executor:
            return fly_elsewhere(self._executor, parts, policy, self._replay, lambda: step(config.plans))
        flown = Flown()
        for part in parts:
            flown.add(fly(part, policy, self._replay, step))
        return flown

    def _save(self, flown: Scalars, half: Half) -> None:
        state = {"epoch": self._number, "flown": flown, "learner": self._learner.state(), **half._asdict()}
        self._folder.save_within(state)
        self._saved_at = time.monotonic()
        self._watcher.kept(half.done)

    def _share(self, steps: float) -> float:
        return steps / (self._config.plans + self._config.updates)
