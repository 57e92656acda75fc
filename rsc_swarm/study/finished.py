"""The journal of an evaluation: finished flights, one JSON line each, so that it can go on after a stop.

The file is named after what was flown: the mission without its seeds, and all code and data that decide a
flight (rsc_swarm.study.fingerprint). Another mission, or edited code, therefore has a journal of its own, and none is ever
overwritten.
"""

import fcntl
import json
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Self

from pydantic import TypeAdapter

from protocols.errors import SwarmError
from protocols.wire.status import SWAP_COUNTS
from rsc_swarm.study.workers import Flight, Seeds

_FLIGHT = TypeAdapter(Flight)


class FinishedFlightsError(SwarmError, RuntimeError):
    """The journal cannot be used now; one line says why."""


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
