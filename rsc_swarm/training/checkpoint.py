"""What a training keeps in its folder, so that it goes on after a stop as if there had been none.

    checkpoint.pt          weights, optimizer and curve after the last whole epoch
    samples/epoch-0003.pt  the graphs flown in an epoch, as long as the replay holds any of them
    curve.jsonl            one line of scalars per epoch; events.* are the same for TensorBoard
    model.onnx             at the end
"""

import json
import os
import pickle
import shutil
from pathlib import Path
from typing import Any

import torch

from rsc_swarm.training.config import TrainingConfig, TrainingError
from rsc_swarm.training.replay import Replay, Samples


class TrainingFolder:
    """The files of one training."""

    def __init__(self, path: Path, config: TrainingConfig) -> None:
        """Make the folder, or open that of an earlier run.

        Raises:
            TrainingError: it cannot be written, or holds a training with another config.
        """
        self.path, self._config = path, config
        self.model = path / "model.onnx"
        self._checkpoint, self._samples = path / "checkpoint.pt", path / "samples"
        try:
            self._samples.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise TrainingError(f"--out {path}: cannot be written ({error.strerror})") from None

    def load(self) -> dict[str, Any] | None:
        """The state after the last whole epoch; None at the beginning.

        Raises:
            TrainingError: the checkpoint is damaged, or of another config.
        """
        if not self._checkpoint.exists():
            return None
        state = _load(self._checkpoint)
        theirs, ours = json.loads(state["config"]), self._config.model_dump(mode="json")
        if differing := [name for name in ours if theirs.get(name) != ours[name]]:
            name = differing[0]
            raise TrainingError(
                f"--out {self.path}: holds a training with {name} {theirs.get(name)}, not {ours[name]}; "
                "give another folder"
            )
        return state

    def save(self, epoch: int, learner: dict[str, Any], curve: list[dict[str, float]], flown: Samples) -> None:
        """Keep the state after an epoch (0, 1, ...) and the graphs flown in it."""
        _write(self._epoch(epoch), flown._asdict())
        state = {"config": self._config.model_dump_json(), "epochs": epoch + 1, "curve": curve}
        _write(self._checkpoint, state | {"learner": learner})
        lines = "".join(json.dumps(scalars) + "\n" for scalars in curve)
        (self.path / "curve.jsonl").write_text(lines, encoding="utf-8")

    def refill(self, replay: Replay, epochs: int) -> None:
        """Put the graphs of the epochs flown so far back into the replay."""
        per_epoch = self._config.worlds * self._config.rounds
        for epoch in range(epochs):
            if (epochs - epoch - 1) * per_epoch >= replay.capacity:
                replay.total += per_epoch  # overwritten since
            else:
                replay.add(Samples(**_load(self._epoch(epoch))))

    def forget(self, epoch: int) -> None:
        """Remove the graphs of an epoch, if there are any."""
        if epoch >= 0:
            self._epoch(epoch).unlink(missing_ok=True)

    def finish(self) -> None:
        """Remove what only going on would need."""
        shutil.rmtree(self._samples)

    def _epoch(self, epoch: int) -> Path:
        return self._samples / f"epoch-{epoch:04}.pt"


def _write(path: Path, state: dict[str, Any]) -> None:
    unfinished = path.with_name(path.name + ".part")
    torch.save(state, unfinished)
    os.replace(unfinished, path)


def _load(path: Path) -> dict[str, Any]:
    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except (OSError, RuntimeError, EOFError, ValueError, KeyError, pickle.UnpicklingError):
        raise TrainingError(f"{path}: is missing or damaged; remove {path.parent} and train anew") from None
