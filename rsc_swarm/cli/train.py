"""``rsc-swarm train``: progress while it trains, and what came out."""

import sys
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from protocols.errors import ExitCode
from rsc_swarm.cli.app import DaskWorkers, announce_compiling, app, examples, with_options
from rsc_swarm.machine.leaving import unwind_when_asked

if TYPE_CHECKING:
    from rsc_swarm.training.config import TrainingConfig
    from rsc_swarm.training.watcher import Scalars

_NEEDED = {"torch", "tensorboard", "onnx", "onnxruntime"}


@dataclass(frozen=True)
class Machines:
    """Options that say where is trained."""

    device: Annotated[str, typer.Option(help="auto, cpu or cuda; auto takes a GPU if there is one.")] = "auto"
    threads: Annotated[int | None, typer.Option(min=1, help="Of torch. (one per processor)")] = None
    on: DaskWorkers = None


@app.command(
    epilog=examples(
        "train --horizon 20",
        "train --horizon 10 --preset paper --out training/paper-h10",
        "train --config mine.yaml --seed 2 --threads 1",
        "train --parts 8 --on tcp://host:8786",
    )
)
@with_options
def train(
    machines: Machines,
    horizon: Annotated[int | None, typer.Option(metavar="H", help="Planned steps of 10 ms. (20)")] = None,
    preset: Annotated[
        str,
        typer.Option(help="default: what ships; paper: the paper's to the letter; stgnn: the baseline."),
    ] = "default",
    config: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Fields of the training config (YAML), on top of it.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of weights, maps and batches. (0)")] = None,
    epochs: Annotated[int | None, typer.Option(help="How often to fly and learn. (20)")] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Checkpoints, curves and model.onnx; goes on with what is there. (training/NAME-SEED)",
        ),
    ] = None,
    parts: Annotated[
        int | None,
        typer.Option(help="Parts in which an epoch's episodes are flown: one for each worker of --on. (1)"),
    ] = None,
) -> None:
    """Train a policy by imitation of the expert and write it as a model file. Ctrl-C and the same command: goes on."""
    announce_compiling()
    from rsc_swarm.training.config import make_config

    made = make_config(preset, config, horizon=horizon, seed=seed, epochs=epochs, parts=parts)
    raise typer.Exit(_train(made, out, machines))


def _train(config: "TrainingConfig", out: Path | None, machines: Machines) -> ExitCode:
    """Train and say what came out.

    Raises:
        TrainingError: a bad device or folder, nobody to fly on, or what training needs is not installed.
        rsc_swarm.study.machines.MachinesError, protocols.mission.document.MissionError: as rsc_swarm.study.machines.crew_of.
    """
    from rsc_swarm.study.machines import Who, check_who, crew_of
    from rsc_swarm.training.config import TrainingError

    who = Who(on=machines.on)
    check_who(who)
    if who.on and config.parts == 1:
        raise TrainingError(
            "--on: the episodes are flown in one part, so in one place; give --parts as well, such as 4"
        )
    try:
        from rsc_swarm.training.dagger import train
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in _NEEDED:
            raise
        raise TrainingError(
            f"training needs {error.name}: pip install -e '.[train]', in the clone of rsc-swarm"
        ) from None
    folder = out or Path("training") / f"{config.name}-{config.seed}"
    progress = _Progress()
    try:
        with unwind_when_asked(), closing(progress), crew_of(who) as crew:
            model = train(config, folder, machines.device, machines.threads, progress, crew.executor)
    except KeyboardInterrupt:
        where = progress.stopped(config)
        print(f"stopped {where} kept, and the same command goes on from there", file=sys.stderr)
        return ExitCode.INTERRUPTED
    print(f"{model}: {model.stat().st_size / 1e6:.1f} MB, {_figures(progress.curve)}")
    return ExitCode.SUCCEEDED


class _Progress:
    """Shows the epochs on a meter (rsc_swarm.training.watcher.Watcher)."""

    def __init__(self) -> None:
        from rsc_swarm.show.progress import Meter

        self.curve: list[Scalars] = []
        self.updates: int | None = None  # of the present epoch, that are kept; None: not even its flights are
        self._meter = Meter()

    def begin(self, config: "TrainingConfig", curve: "list[Scalars]") -> None:
        self.curve, self._epochs = list(curve), config.epochs
        self._meter.begin(self._said(), total=self._epochs, done=len(curve))

    def step(self, share: float) -> None:
        if self._meter.due():
            self._meter.draw(len(self.curve) + share, self._said())

    def kept(self, updates: int) -> None:
        self.updates = updates

    def epoch(self, scalars: "Scalars") -> None:
        self.curve.append(scalars)
        self.updates = None

    def close(self) -> None:
        self._meter.close()

    def stopped(self, config: "TrainingConfig") -> str:
        """Where training was stopped, and what of it is (kept)."""
        epoch = len(self.curve) + 1
        if epoch > config.epochs:
            return "while the model was written; all epochs are"
        kept = "the epochs before are" if epoch > 2 else "the first epoch is" if epoch == 2 else "nothing is"
        if self.updates is not None:
            part = f"of this one its flights and {self.updates} of {config.updates} updates"
            kept = f"{part} are" if epoch == 1 else f"{kept.rsplit(' ', 1)[0]} and {part} are"
        return f"in epoch {epoch} of {config.epochs}; {kept}"

    def _said(self) -> str:
        return f"epoch {min(len(self.curve) + 1, self._epochs)} of {self._epochs}, {_figures(self.curve)}"


def _figures(curve: "list[Scalars]") -> str:
    """The newest scalars, for people."""
    if not curve:
        return "nothing learned yet"
    last = curve[-1]
    text = f"loss {last['loss']:.3g}, plans off by {1000 * last['mae_m']:.2f} mm"
    return text + (f", {100 * last['success']:.0f} % of its flights succeed" if "success" in last else "")
