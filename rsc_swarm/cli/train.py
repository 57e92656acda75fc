"""``rsc-swarm train``: progress while it trains, and what came out."""

import sys
import time
from contextlib import closing
from pathlib import Path

from rsc_swarm.show.meter import Meter
from rsc_swarm.training.config import TrainingConfig, TrainingError, make_config
from rsc_swarm.training.watcher import Scalars, Watcher

_NEEDED = {"torch", "tensorboard", "onnx", "onnxruntime"}


def run(
    preset: str,
    file: Path | None,
    out: Path | None,
    device: str,
    threads: int | None,
    **given: int | str | None,
) -> int:
    """Train and say what came out; the exit code. ``given``: fields of the config, None where not given.

    Raises:
        TrainingError: a bad config, device or folder, or what training needs is not installed.
    """
    config = make_config(preset, file, **given)
    try:
        from rsc_swarm.training.dagger import train
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in _NEEDED:
            raise
        raise TrainingError(f"training needs {error.name}: pip install 'rsc-swarm[train]'") from None
    folder = out or Path("training") / f"{config.name}-{config.seed}"
    progress = _Progress()
    try:
        with closing(progress):
            model = train(config, folder, device, threads, progress)
    except KeyboardInterrupt:
        kept = "the epochs before are kept, and the same command goes on from there"
        print(f"stopped in epoch {len(progress.curve) + 1} of {config.epochs}; {kept}", file=sys.stderr)
        return 130
    print(f"{model}: {model.stat().st_size / 1e6:.1f} MB, {_figures(progress.curve)}")
    return 0


class _Progress(Watcher):
    """Shows the epochs on a meter."""

    def __init__(self) -> None:
        self.curve: list[Scalars] = []
        self._meter = Meter()

    def begin(self, config: TrainingConfig, curve: list[Scalars]) -> None:
        self.curve, self._known, self._epochs = list(curve), len(curve), config.epochs
        self._begin = time.monotonic()
        self._meter.begin(self._said(0.0), total=self._epochs)

    def step(self, share: float) -> None:
        if self._meter.due():
            self._meter.draw(len(self.curve) + share, self._said(share))

    def epoch(self, scalars: Scalars) -> None:
        self.curve.append(scalars)

    def close(self) -> None:
        self._meter.close()

    def _said(self, share: float) -> str:
        done = len(self.curve) + share - self._known
        text = f"epoch {min(len(self.curve) + 1, self._epochs)} of {self._epochs}, {_figures(self.curve)}"
        if done < 0.2:
            return text
        spent = time.monotonic() - self._begin
        return f"{text}, {spent / done * (self._epochs - self._known - done):.0f} s left"


def _figures(curve: list[Scalars]) -> str:
    """The newest scalars, for people."""
    if not curve:
        return "nothing learned yet"
    last = curve[-1]
    text = f"loss {last['loss']:.3g}, plans off by {1000 * last['mae_m']:.2f} mm"
    return text + (f", {100 * last['success']:.0f} % of its flights succeed" if "success" in last else "")
