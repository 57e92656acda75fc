"""``--mcap``: a flight as a file that other programs open, right after it was flown.

What that needs is loaded only where it is asked for.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from protocols.mission.document import Mission
from protocols.whole_file import WriteError
from rsc_swarm.cli.output import check_place
from rsc_swarm.machine.leaving import passing_folder

if TYPE_CHECKING:
    from rsc_swarm.flight.report import FlightReport
    from rsc_swarm.flight.run_dir import RunDir


class McapOutput:
    """A checked ``--mcap``: a file, or none."""

    def __init__(self, given: Path | None) -> None:
        """Refuse one that could not be written, before anything is flown.

        Raises:
            protocols.mission.document.MissionError: as `check_place`.
            rsc_swarm.show.foxglove.file.McapError: what writes such files is missing.
        """
        self._file = given
        if given is None:
            return
        check_place("--mcap", given)
        from rsc_swarm.show.foxglove.file import check_mcap

        check_mcap()

    @contextmanager
    def place(self, folder: "RunDir | None") -> "Iterator[RunDir | None]":
        """Where the flight is to be recorded: in its run directory; without one, in a passing folder if that is needed."""
        if folder or self._file is None:
            yield folder
            return
        from rsc_swarm.flight.run_dir import RunDir

        with passing_folder() as passing:
            yield RunDir(passing)

    def write(self, place: "RunDir | None", mission: Mission, report: "FlightReport") -> None:
        """Write what was recorded in ``place``, if that was asked for.

        Raises:
            protocols.whole_file.WriteError: it cannot be written, or nothing was recorded.
        """
        if self._file is None or place is None:
            return
        from rsc_swarm.flight.events import end_told
        from rsc_swarm.flight.recorded import Recorded
        from rsc_swarm.show.foxglove.file import write_mcap
        from world.outlets.trajectory import Trajectory

        if not place.trajectory.is_file():
            raise WriteError(f"--mcap {self._file}: nothing was recorded")
        path = Trajectory.load(place.trajectory)
        write_mcap(Recorded(mission, path, end_told(report), report.tau_s, report), self._file)
