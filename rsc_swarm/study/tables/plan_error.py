"""How well a row's model foretells the expert, measured once and kept beside the row's flights."""

import signal
from collections.abc import Sequence
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path

from agent.policy.model_file import SHIPPED
from protocols.mission.document import Mission, MissionError
from protocols.whole_file import write_whole
from rsc_swarm.batch.batch import check_flyable
from rsc_swarm.study.tables.result import Accuracy
from rsc_swarm.study.workers import Seeds, WorkerError

_MAPS = 20  # the error is a mean over thousands of plans, so a few maps are enough


def accuracy_of(mission: Mission, journal: Path, seeds: Sequence[Seeds]) -> Accuracy | None:
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
        return Accuracy.model_validate_json(kept.read_bytes())
    measured = _in_child(model, mission, maps)
    write_whole(kept, measured.model_dump_json() + "\n")
    return measured


def _in_child(model: Path, mission: Mission, maps: list[int]) -> Accuracy:
    """Measure in a process of its own: one that has run a model must not be forked, and the next row forks."""
    context = get_context("fork")
    ours, theirs = context.Pipe(duplex=False)
    child = context.Process(target=_measure, args=(theirs, model, mission, maps), daemon=True)
    child.start()
    theirs.close()
    try:
        said = ours.recv()
    except EOFError:
        child.join(1.0)
        said = f"it died (exit code {child.exitcode})"
    finally:
        child.terminate()
        child.join()
    if isinstance(said, str):
        raise WorkerError(f"measuring the accuracy of {model.stem}: {said}")
    return Accuracy(model_m=said[0], constant_velocity_m=said[1])


def _measure(pipe: Connection, model: Path, mission: Mission, maps: list[int]) -> None:
    from rsc_swarm.study.accuracy import mae

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        pipe.send(mae(model, mission, maps))
    except Exception as error:
        pipe.send(f"{type(error).__name__}: {' '.join(str(error).split())}")
