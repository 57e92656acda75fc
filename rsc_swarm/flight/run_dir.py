"""The run directory (``--run-dir``): everything about one flight in one place.

    mission.yaml     the mission, every field; fly it with --mission
    report.json      the report (docs/report.md)
    report.txt       the same for people
    trajectory.npz   every drone's path (world.outlets.recorder)
    logs/            one file per process, of a launch

A directory that already holds a flight is used again; one that holds anything else is refused.
"""

import shutil
from pathlib import Path

import yaml

from protocols.errors import SwarmError
from protocols.mission.document import Mission
from protocols.whole_file import write_whole
from rsc_swarm.show.report import FlightReport

_MARK = "# A flight of rsc-swarm: this is its mission, with every field.\n"


class RunDirError(SwarmError, RuntimeError):
    """The directory cannot be used; one line says why."""


class RunDir:
    """The directory of one flight."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.mission = path / "mission.yaml"
        self.report = path / "report.json"
        self.text = path / "report.txt"
        self.trajectory = path / "trajectory.npz"
        self.logs = path / "logs"

    def begin(self, mission: Mission) -> None:
        """Make the directory, or empty it of an earlier flight, and write the mission.

        Raises:
            RunDirError: the directory holds something else, or cannot be written.
        """
        try:
            if self.path.exists() and not self.path.is_dir():
                raise RunDirError(f"--run-dir {self.path}: is a file; give a directory")
            if self.path.is_dir() and any(self.path.iterdir()) and not self._is_ours():
                raise RunDirError(
                    f"--run-dir {self.path}: holds other things than a flight; give an empty or new directory"
                )
            self.path.mkdir(parents=True, exist_ok=True)
            for old in (self.report, self.text, self.trajectory):
                old.unlink(missing_ok=True)
            shutil.rmtree(self.logs, ignore_errors=True)
            self.logs.mkdir()
            write_whole(self.mission, _MARK + mission_yaml(mission))
        except OSError as error:
            raise RunDirError(f"--run-dir {self.path}: cannot be written ({error.strerror})") from None

    def finish(self, report: FlightReport, text: str) -> None:
        """Write the report, for programs and for people."""
        write_whole(self.report, report.model_dump_json(indent=2) + "\n")
        write_whole(self.text, text)

    def check(self) -> None:
        """Look whether a flight is in here.

        Raises:
            RunDirError: none is.
        """
        if not self._is_ours() or not self.trajectory.is_file():
            raise RunDirError(
                f"--run-dir {self.path}: no flight recorded here; simulate or launch with --run-dir makes one"
            )

    def _is_ours(self) -> bool:
        try:
            with self.mission.open(encoding="utf-8") as file:
                return file.readline() == _MARK
        except (OSError, UnicodeDecodeError):
            return False


def mission_yaml(mission: Mission) -> str:
    """The mission as YAML, every field."""
    return yaml.safe_dump(
        mission.model_dump(mode="json"), sort_keys=False, width=110, default_flow_style=None
    )
