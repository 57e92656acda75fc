"""The journal of an evaluation: finished flights, one JSON line each, so that it can go on after a stop.

The file is named after what was flown: the mission without its seeds, and all code and data that decide a
flight. Another mission, or edited code, therefore has a journal of its own, and none is ever overwritten.
"""

import fcntl
import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import Self

import numba
import numpy as np
from pydantic import TypeAdapter

from agent.policy import files_of, find_policy
from protocols.errors import SwarmError
from protocols.mission.document import Mission
from protocols.wire.status import SWAP_COUNTS
from rsc_swarm.batch.expert import EXPERT
from rsc_swarm.batch.expert import FILES as EXPERT_FILES
from rsc_swarm.study.workers import Flight, Seeds

_ROOT = Path(__file__).resolve().parents[2]
_FLIGHT = TypeAdapter(Flight)
_DECIDING = ("protocols", "agent", "world", "rsc_swarm/flight/simulate.py")


class FinishedFlightsError(SwarmError, RuntimeError):
    """The journal cannot be used now; one line says why."""


def fingerprint(mission: Mission) -> str:
    """16 hexadecimal digits: equal only for missions that differ in nothing but seeds, and the same code.

    Raises:
        agent.policy.PolicyError: the mission's policy cannot be found or made.
    """
    fields = mission.model_dump(mode="json", exclude={"map_seed", "seed", "name"})
    digest = hashlib.blake2b(json.dumps(fields, sort_keys=True).encode(), digest_size=8)
    digest.update(f"{numba.__version__} {np.__version__} {version('onnxruntime')}".encode())
    for path in _deciding_files(mission):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _deciding_files(mission: Mission) -> Iterator[Path]:
    for place in _DECIDING:
        path = _ROOT / place
        for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
            if file.is_file() and "__pycache__" not in file.parts and file.suffix not in (".onnx", ".json"):
                yield file
    if mission.policy == EXPERT:
        yield from EXPERT_FILES
        return
    yield from files_of(find_policy(mission.policy, mission))


class FinishedFlights:
    """Flights finished so far, in ``path``, which grows by one line per flight."""

    def __init__(self, path: Path) -> None:
        """Open or make the journal.

        Raises:
            FinishedFlightsError: another evaluation is writing it, or it cannot be opened.
        """
        self.path = path
        try:
            self._file = path.open("a+", encoding="utf-8", errors="replace")
        except OSError as error:
            raise FinishedFlightsError(f"{path}: cannot be written ({error.strerror})") from None
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._file.close()
            raise FinishedFlightsError(
                f"{path}: another evaluation is writing here; wait for it or write elsewhere"
            ) from None
        self._file.seek(0)
        text = self._file.read()
        self.flights: dict[Seeds, Flight] = {}
        for line in text.splitlines():
            flight = _parse(line)
            if flight:
                self.flights[flight.map_seed, flight.seed] = flight
        if text and not text.endswith("\n"):  # the last writer was cut off in mid-line
            self._file.write("\n")

    def add(self, flight: Flight) -> None:
        """Keep one more flight.

        Raises:
            FinishedFlightsError: the disk is full, say.
        """
        self.flights[flight.map_seed, flight.seed] = flight
        try:
            self._file.write(json.dumps(asdict(flight)) + "\n")
            self._file.flush()
        except OSError as error:
            raise FinishedFlightsError(f"{self.path}: cannot be written ({error.strerror})") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()


def _parse(line: str) -> Flight | None:
    """A flight, or None for a line that was cut off or is something else."""
    try:
        flight = _FLIGHT.validate_json(line, strict=True)
    except ValueError:
        return None
    return flight if flight.swaps.keys() == set(SWAP_COUNTS) else None
