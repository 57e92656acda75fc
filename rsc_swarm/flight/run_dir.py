"""The run directory (``--run-dir``): everything about one flight in one place.

    mission.yaml     the mission, every field; fly it with --mission, from any folder
    policy/          a policy that is a file of one's own, or a model file; mission.yaml names it there
    report.json      the report (docs/report.md), with versions and the hashes of what lies in policy/
    report.txt       the same for people
    report.html      the same as a page, once rsc-swarm report has made it
    trajectory.npz   every drone's path (world.outlets.recorder)
    events.jsonl     what happened, one line each (rsc_swarm.flight.events)
    logs/            one file per process, of a launch

A directory that already holds a flight is used again only if that is asked for; one that holds anything else is refused.
"""

import os
import shutil
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from protocols.errors import SwarmError
from protocols.foreign_file import read_file
from protocols.mission.document import Mission, mission_yaml
from protocols.mission.fault import Fault
from protocols.mission.policy_name import file_of, named_by
from protocols.whole_file import keep_all, write_whole
from rsc_swarm.flight.events import End, events_of, json_lines
from rsc_swarm.flight.report import FlightReport, Printable
from rsc_swarm.machine.abandoned import hold
from world.outlets.trajectory import Trajectory

_MARK = "# A flight of rsc-swarm: this is its mission, with every field.\n"


class RunDirError(SwarmError, RuntimeError):
    """The directory cannot be used; one line says why."""


@dataclass(frozen=True)
class Ended:
    """Time of success, if there was one, and what else ended the flight."""

    tau_s: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None
    failure: Printable | None


_ENDED = TypeAdapter(Ended)


class RunDir:
    """The directory of one flight."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.policy = path / "policy"
        self.mission = path / "mission.yaml"
        self.report = path / "report.json"
        self.text = path / "report.txt"
        self.trajectory = path / "trajectory.npz"
        self.events = path / "events.jsonl"
        self.page = path / "report.html"
        self.logs = path / "logs"
        self._mission: Mission | None = None  # as it was written down
        self._locked: weakref.finalize[Any, Any] | None = None

    def begin(self, mission: Mission, policy_files: Sequence[Path] = (), overwrite: bool = False) -> None:
        """Make the directory, and write the mission and its policy.

        Args:
            policy_files: what decides what the policy does (agent.policy.files_of).
            overwrite: empty the directory of an earlier flight.

        Raises:
            RunDirError: the directory holds a flight or something else, or it cannot be written.
        """
        named = file_of(mission.policy)
        try:
            copies = _beside(Path(named), policy_files) if named else {}
            if self.path.exists() and not self.path.is_dir():
                raise RunDirError(f"--run-dir {self.path}: is a file; give a directory")
            self.path.mkdir(parents=True, exist_ok=True)
            self._lock()  # before anything is looked at that another run may be about to write
            if any(self.path.iterdir()) and not self._is_ours():
                raise RunDirError(
                    f"--run-dir {self.path}: holds other things than a flight; give an empty or new directory"
                )
            if not overwrite and any(kept.exists() for kept in (self.report, self.text, self.trajectory)):
                raise RunDirError(
                    f"--run-dir {self.path}: holds a flight already; give a new directory, or --overwrite"
                )
            for old in (self.report, self.text, self.trajectory, self.events, self.page):
                old.unlink(missing_ok=True)
            for folder in (self.logs, self.policy):
                shutil.rmtree(folder, ignore_errors=True)
            self.logs.mkdir()
            if named:
                self.policy.mkdir()
                copied = named_by(mission.policy, self.policy.relative_to(self.path) / Path(named).name)
                mission = mission.model_copy(update={"policy": copied})
            write_whole(self.mission, _MARK + mission_yaml(mission))
            self._mission = mission
            for name, content in copies.items():
                (self.policy / name).parent.mkdir(parents=True, exist_ok=True)
                write_whole(self.policy / name, content)
        except OSError as error:
            raise RunDirError(f"--run-dir {self.path}: cannot be written ({error.strerror})") from None

    def _lock(self) -> None:
        """Keep the directory to this flight: as long as this object lives, or a process forked by then.

        Raises:
            RunDirError: another run writes here.
        """
        if self._locked:
            return
        try:
            held = hold(self.path)
        except BlockingIOError:
            raise RunDirError(
                f"--run-dir {self.path}: another run writes there; give a new directory, or wait for its end"
            ) from None
        self._locked = weakref.finalize(self, os.close, held)

    def add_faults(self, faults: Sequence[Fault]) -> None:
        """Write down what hands did while the mission was flown: with it, it flies so again.

        Raises:
            protocols.whole_file.WriteError: it cannot be written.
        """
        if faults and self._mission:
            flown = self._mission.model_copy(update={"faults": (*self._mission.faults, *faults)})
            write_whole(self.mission, _MARK + mission_yaml(flown))

    def save_path(self, path: Trajectory, mission: Mission, end: End) -> None:
        """Write every drone's path, and what happened on it.

        Raises:
            protocols.whole_file.WriteError: one of them cannot be written, or neither; the other is, if it can.
        """
        keep_all(
            partial(path.save, self.trajectory),
            lambda: write_whole(self.events, json_lines(events_of(path, mission, end))),
        )

    def finish(self, report: FlightReport, text: str) -> None:
        """Write the report, for programs and for people.

        Raises:
            protocols.whole_file.WriteError: it cannot be written.
        """
        write_whole(self.report, report.model_dump_json(indent=2) + "\n")
        write_whole(self.text, text)

    def check(self) -> None:
        """Look whether a flight is in here.

        Raises:
            RunDirError: none is.
        """
        if not self._is_ours() or not self.trajectory.is_file():
            raise RunDirError(
                f"{self.path}: no flight recorded here; simulate or launch with --run-dir makes one"
            )

    def told(self) -> tuple[Ended, bytes]:
        """How the flight in here ended, and its report; as interrupted, and nothing, if nobody came to write one.

        Raises:
            RunDirError: the report is none.
        """
        if not self.report.is_file():
            return Ended(None, "interrupted"), b""
        try:
            report = read_file(self.report)
            return _ENDED.validate_json(report), report
        except (ValidationError, OSError):
            raise RunDirError(f"{self.report}: is not the report of a flight") from None

    def _is_ours(self) -> bool:
        try:
            if not self.mission.is_file():
                return False
            with self.mission.open(encoding="utf-8") as file:
                return file.readline(len(_MARK)) == _MARK
        except (OSError, UnicodeDecodeError):
            return False


def _beside(named: Path, files: Sequence[Path]) -> dict[Path, bytes]:
    """By path from there, the content of those of ``files`` that lie where the policy's file does, or in a folder beside it."""
    folder = named.absolute().parent
    inside = [file.absolute() for file in files if file.absolute().is_relative_to(folder)]
    return {file.relative_to(folder): file.read_bytes() for file in inside}
