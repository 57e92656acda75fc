"""How well a row's model foretells the expert, measured once and kept beside the row's flights."""

from collections.abc import Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path

from pydantic import ValidationError

from agent.policy.model_file import SHIPPED
from protocols.errors import SwarmError
from protocols.foreign_file import read_file
from protocols.mission.document import Mission, MissionError
from protocols.whole_file import write_whole
from rsc_swarm.batch.batch import check_flyable
from rsc_swarm.machine.leaving import be_worker
from rsc_swarm.study.tables.result import Accuracy
from rsc_swarm.study.workers import Seeds, WorkerError

_MAPS = 20  # the error is a mean over thousands of plans, so a few maps are enough


def accuracy_of(
    mission: Mission, journal: Path, seeds: Sequence[Seeds], executor: Executor | None = None
) -> Accuracy | None:
    """The accuracy of the mission's model on the first maps of ``seeds``; None for a controller that foretells
    nothing, and where the expert cannot fly.

    Raises:
        WorkerError: the measuring process broke.
    """
    model = SHIPPED / f"{mission.policy}.onnx"
    if not (mission.policy.startswith("rsc-h") and model.is_file()):
        return None
    try:
        check_flyable(mission)
    except MissionError:
        return None
    maps = list(dict.fromkeys(map_seed for map_seed, _ in seeds))[:_MAPS]
    kept = journal.with_name(
        f"{journal.name.removesuffix('.journal.jsonl')}.accuracy-{maps[0]}-{len(maps)}.json"
    )
    if kept.is_file():
        with suppress(ValidationError, OSError):  # what cannot be read is measured anew
            return Accuracy.model_validate_json(read_file(kept))
    if executor:
        measured = _measured(executor, model, mission, maps)
    else:  # in a process of its own: one that has run a model must not be forked, and the next row forks
        with ProcessPoolExecutor(1, get_context("fork"), be_worker) as pool:
            measured = _measured(pool, model, mission, maps)
    write_whole(kept, measured.model_dump_json() + "\n")
    return measured


def _measured(executor: Executor, model: Path, mission: Mission, maps: list[int]) -> Accuracy:
    try:
        model_m, constant_m = executor.submit(_measure, model.name, mission, maps).result()
    except SwarmError:
        raise
    except BrokenProcessPool:
        raise WorkerError(f"measuring the accuracy of {model.stem}: the process died") from None
    except Exception as error:
        said = f"{type(error).__name__}: {' '.join(str(error).split())}"
        raise WorkerError(f"measuring the accuracy of {model.stem}: {said}") from error
    return Accuracy(model_m=model_m, constant_velocity_m=constant_m)


def _measure(model: str, mission: Mission, maps: list[int]) -> tuple[float, float]:
    from rsc_swarm.study.accuracy import mae

    return mae(SHIPPED / model, mission, maps)
