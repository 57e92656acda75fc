"""What a training keeps in its folder, so that it goes on after a stop as if there had been none.

checkpoint.pt          weights, optimizer and curve after the last whole epoch
within.pt              the same amid the epoch after it, every minute of learning, and what its flights added up to
samples/epoch-0003.pt  the graphs flown in an epoch, as long as the replay holds any of them
curve.jsonl            one line of scalars per epoch; events.* are the same for TensorBoard
model.onnx, model.json at the end: the policy and its note
"""

import io
import json
import math
import os
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import torch

from protocols.whole_file import write_whole
from rsc_swarm.machine.abandoned import hold
from rsc_swarm.training.config import TrainingConfig, TrainingError
from rsc_swarm.training.replay import Replay, Samples
from rsc_swarm.training.watcher import Scalars

_VERSION = 3  # of the checkpoint


class TrainingFolder:
    """The files of one training."""

    def __init__(self, path: Path, config: TrainingConfig) -> None:
        """Make the folder, or open that of an earlier run.

        Raises:
            TrainingError: it cannot be written, or holds a training with another config.
        """
        self.path, self._config = path, config
        self.model = path / "model.onnx"
        self._per_epoch = config.worlds * config.plans
        self._checkpoint, self._samples = path / "checkpoint.pt", path / "samples"
        self._within = path / "within.pt"
        self._whose = {"version": _VERSION, "config": config.model_dump_json()}
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise TrainingError(f"--out {path}: cannot be written ({error.strerror})") from None

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keep others from training here.

        Raises:
            TrainingError: another command does.
        """
        with ExitStack() as until_the_end:
            try:
                until_the_end.callback(os.close, hold(self.path))
            except BlockingIOError:
                raise TrainingError(
                    f"--out {self.path}: another command trains here; wait for it, or give another folder"
                ) from None
            except OSError:
                pass  # not every file system locks folders
            yield

    def load(self) -> dict[str, Any] | None:
        """The state after the last whole epoch; None at the beginning.

        Raises:
            TrainingError: the checkpoint is damaged, or of another version or config.
        """
        if not self._checkpoint.exists():
            return None
        state = _load(self._checkpoint)
        if state.get("version") != _VERSION:
            raise TrainingError(
                f"--out {self.path}: holds a training of another version; give another folder"
            )
        self._check_config(state, self._checkpoint)
        if not isinstance(state.get("curve"), list) or not isinstance(state.get("learner"), dict):
            raise _damaged(self._checkpoint)
        return state

    def _check_config(self, state: dict[str, Any], path: Path) -> None:
        ours = self._config.model_dump(mode="json")
        # A field that came later has its usual value in an older training.
        theirs = TrainingConfig.model_construct().model_dump(mode="json") | _config_in(state, path)
        if differing := [name for name in ours if theirs[name] != ours[name]]:
            name = differing[0]
            raise TrainingError(
                f"--out {self.path}: holds a training with {name} {theirs[name]}, not {ours[name]}; "
                "give another folder"
            )

    def load_within(self, epoch: int) -> dict[str, Any] | None:
        """The state amid ``epoch``, as `save_within` was given it; None if that was not saved.

        Raises:
            TrainingError: it is damaged, or of another config.
        """
        if not self._within.exists():
            return None
        state = _load(self._within)
        if state.get("epoch") != epoch or state.get("version") != _VERSION:
            return None
        self._check_config(state, self._within)
        return state

    def save_flown(self, epoch: int, replay: Replay) -> None:
        """Keep the graphs that were flown in ``epoch``, the newest in the replay."""
        self._samples.mkdir(exist_ok=True)
        _write(self._epoch(epoch), replay.newest(self._per_epoch)._asdict())

    def save_within(self, state: dict[str, Any]) -> None:
        """Keep the state amid an epoch whose flights are kept already; ``state`` says which it is."""
        _write(self._within, {**self._whose, **state})

    def save(self, curve: list[Scalars], learner: dict[str, Any], replay: Replay) -> None:
        """Keep the state after the newest epoch of the curve."""
        epoch = len(curve) - 1
        _write(self._checkpoint, {**self._whose, "curve": curve, "learner": learner})
        lines = "".join(json.dumps(scalars) + "\n" for scalars in curve)
        write_whole(self.path / "curve.jsonl", lines)
        overwritten = epoch - math.ceil(replay.capacity / self._per_epoch)
        self._epoch(overwritten).unlink(missing_ok=True)
        self._within.unlink(missing_ok=True)

    def refill(self, replay: Replay, epochs: int) -> None:
        """Put the graphs of the epochs flown so far back into the replay.

        Raises:
            TrainingError: a file is missing or damaged.
        """
        for epoch in range(epochs):
            if (epochs - 1 - epoch) * self._per_epoch >= replay.capacity:
                replay.total += self._per_epoch  # overwritten since
            else:
                try:
                    replay.add(Samples(**_load(self._epoch(epoch))))
                except (TypeError, AttributeError, RuntimeError):  # other arrays, or none
                    raise _damaged(self._epoch(epoch)) from None

    def finish(self) -> None:
        """Remove what only going on would need."""
        self._within.unlink(missing_ok=True)
        shutil.rmtree(self._samples, ignore_errors=True)

    def _epoch(self, epoch: int) -> Path:
        return self._samples / f"epoch-{epoch:04}.pt"


def _write(path: Path, state: dict[str, Any]) -> None:
    written = io.BytesIO()  # of what a disk says torch would make an error of its own
    torch.save(state, written)
    write_whole(path, written.getvalue())


def _load(path: Path) -> dict[str, Any]:
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
    except Exception:  # what a file can do to torch's reader has no base of its own
        raise _damaged(path) from None
    if not isinstance(state, dict) or not all(isinstance(name, str) for name in state):
        raise _damaged(path)
    return state


def _config_in(state: dict[str, Any], path: Path) -> dict[str, Any]:
    try:
        config = json.loads(state["config"])
    except (KeyError, TypeError, ValueError, RecursionError):
        raise _damaged(path) from None
    if not isinstance(config, dict):
        raise _damaged(path)
    return config


def _damaged(path: Path) -> TrainingError:
    return TrainingError(f"{path}: is missing or damaged; remove {path.parent} and train anew")
