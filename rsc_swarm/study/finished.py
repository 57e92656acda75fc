"""Journals: what has been flown so far, one JSON line each, so that it can go on after a stop.

A file is named after what was flown: the mission without its seeds, and all code and data that decide a
flight (rsc_swarm.study.fingerprint). Another mission, or edited code, therefore has a journal of its own, and none is ever
overwritten.
"""

import fcntl
import json
from abc import ABC, abstractmethod
from collections.abc import Hashable
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any, Generic, Self, TypeVar

from pydantic import TypeAdapter

from protocols.errors import SwarmError
from protocols.wire.status import SWAP_COUNTS
from rsc_swarm.study.workers import Flight, Seeds

JOURNAL = ".journal.jsonl"  # how the name of one ends
_FLIGHT = TypeAdapter(Flight)
_Key = TypeVar("_Key", bound=Hashable)
_Record = TypeVar("_Record")


class FinishedFlightsError(SwarmError, RuntimeError):
    """The journal cannot be used now; one line says why."""


class Journal(ABC, Generic[_Key, _Record]):
    """What has been flown so far, ``finished``, in ``path``, which grows by one line each."""

    def __init__(self, path: Path) -> None:
        """Open or make the journal.

        Raises:
            FinishedFlightsError: another command is writing it, or it cannot be opened.
        """
        self.path = path
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise FinishedFlightsError(f"{path}: is no file; give another place, or remove it")
        try:
            self._file = path.open("a+", encoding="utf-8", errors="replace")
        except OSError as error:
            raise FinishedFlightsError(f"{path}: cannot be written ({error.strerror})") from None
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._file.close()
            raise FinishedFlightsError(
                f"{path}: another command is writing here; wait for it or write elsewhere"
            ) from None
        self._file.seek(0)
        text = self._file.read()
        records = (self._parse(line) for line in text.splitlines())
        self.finished: dict[_Key, _Record] = {self._key(record): record for record in records if record}
        if text and not text.endswith("\n"):  # the last writer was cut off in mid-line
            self._file.write("\n")

    @staticmethod
    @abstractmethod
    def _key(record: _Record) -> _Key:
        """What it is known by."""

    @staticmethod
    @abstractmethod
    def _parse(line: str) -> _Record | None:
        """What a line says, or None for one that was cut off or is something else."""

    @staticmethod
    @abstractmethod
    def _fields(record: _Record) -> dict[str, Any]:
        """What is written of it."""

    def add(self, record: _Record) -> None:
        """Keep one more.

        Raises:
            FinishedFlightsError: the disk is full, say.
        """
        self.finished[self._key(record)] = record
        try:
            self._file.write(json.dumps(self._fields(record)) + "\n")
            self._file.flush()
        except OSError as error:
            raise FinishedFlightsError(f"{self.path}: cannot be written ({error.strerror})") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(OSError):  # of a line for which there was no room, as `add` has said
            self._file.close()


class FinishedFlights(Journal[Seeds, Flight]):
    """The flights of an evaluation."""

    @staticmethod
    def _key(record: Flight) -> Seeds:
        return record.map_seed, record.seed

    @staticmethod
    def _parse(line: str) -> Flight | None:
        try:
            flight = _FLIGHT.validate_json(line, strict=True)
        except ValueError:
            return None
        return flight if flight.swaps.keys() == set(SWAP_COUNTS) else None

    @staticmethod
    def _fields(record: Flight) -> dict[str, Any]:
        return asdict(record)


def journal_path(results: Path, code: str) -> Path:
    """Where what is flown under this fingerprint is kept while ``results`` is being made."""
    return results.with_name(f"{results.stem}.{code}{JOURNAL}")
