"""A flight as its run directory keeps it, read again: what a report, a picture or another program's file is made from."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from protocols.mission.document import Mission, parse_mission, read_mission_fields
from rsc_swarm.flight.events import End, Event, end_told, events_of
from rsc_swarm.flight.report import FlightReport
from rsc_swarm.flight.run_dir import RunDir, RunDirError
from world.outlets.trajectory import Trajectory

_IN_SIGHT_M = 60.0


@dataclass(frozen=True)
class Recorded:
    """A recorded flight and how it ended. report: None of a flight on the air, and of one that nobody came to report. tau_s:
    time of success, if there was one. told: the report as it was written, whatever its version."""

    mission: Mission
    path: Trajectory
    end: End
    tau_s: float | None
    report: FlightReport | None = None
    told: bytes = b""

    @classmethod
    def load(cls, folder: RunDir) -> "Recorded":
        """The flight in ``folder``.

        Raises:
            rsc_swarm.flight.run_dir.RunDirError, MissionError, TrajectoryError: there is none, or it cannot be read.
        """
        folder.check()
        mission = parse_mission(read_mission_fields(folder.mission), str(folder.mission))
        path, (ended, told) = Trajectory.load(folder.trajectory), folder.told()
        rows, agents = path.slots.shape
        fits = agents == mission.agents and rows and 0 <= path.slots.min() <= path.slots.max() < agents
        numbers = path.positions, path.velocities, path.obstacles, path.goal_x, path.tick_s
        if not fits or not all(np.isfinite(part).all() for part in numbers) or path.tick_s <= 0:
            raise RunDirError(f"{folder.trajectory}: is not the flight of the mission beside it")
        report = _report(told, mission)
        if report is None:
            verdict = (ended.failure or "in formation beyond the goal line").replace("-", " ")
            return cls(
                mission,
                path,
                End(ended.failure, f"{verdict} after {ended.tau_s or path.times[-1]:.2f} s"),
                ended.tau_s,
                told=told,
            )
        return cls(mission, path, end_told(report), report.tau_s, report, told)

    @property
    def failure(self) -> str | None:
        """What ended it; None after a success."""
        return self.end.failure

    @property
    def verdict(self) -> str:
        """How it ended, in a few words."""
        drones = "1 drone" if self.mission.agents == 1 else f"{self.mission.agents} drones"
        if self.tau_s is None or self.failure:
            return f"{drones}: {(self.failure or 'unknown end').replace('-', ' ')}"
        where = "at the goal" if self.mission.agents == 1 else "in formation"
        return f"{drones}, {where} after {self.tau_s:.1f} s"

    @property
    def final_row(self) -> int:
        """The row of success, else the last."""
        last = len(self.path.slots) - 1
        return last if self.tau_s is None else round(min(last, self.tau_s / self.path.tick_s))

    @property
    def goal_in_sight(self) -> bool:
        """Whether the goal line belongs on a picture: not where it is far from all that was flown."""
        return bool(self.path.goal_x - self.path.positions[:, :, 0].max() <= _IN_SIGHT_M)

    @property
    def frame(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lower left and upper right corner of what is to be seen, (2,) each, m: the paths, obstacles, and the goal line."""
        points, discs = self.path.positions.reshape(-1, 2), self.path.obstacles
        goal = [(self.path.goal_x, points[0, 1])] if self.goal_in_sight else []
        seen = np.concatenate(
            [points, discs[:, :2] - discs[:, 2:], discs[:, :2] + discs[:, 2:], np.reshape(goal, (-1, 2))]
        )
        return seen.min(axis=0), seen.max(axis=0)

    @cached_property
    def events(self) -> list[Event]:
        """What happened, in order."""
        return events_of(self.path, self.mission, self.end)


def _report(told: bytes, mission: Mission) -> FlightReport | None:
    """The report of a flight of ``mission``; None if there is none, or it is of another version."""
    try:
        report = FlightReport.model_validate_json(told)
    except ValidationError:
        return None
    if not all(0 <= place < len(mission.faults) for place in report.missed_faults):
        return None
    return report.model_copy(update={"mission": mission.model_dump(mode="json")})
