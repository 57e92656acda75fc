"""A flight of a run directory as pictures: flown again where that gives the same flight, else as its paths were recorded.

A flight in lockstep repeats bit for bit, so flying it again shows all that was to be seen: the radio, what drones believed.
Whether it was the same flight, its digest says. Of others there is where the drones were, and in which slots.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from protocols.errors import SwarmError
from protocols.mission.document import Mission
from rsc_swarm.flight.again import fly_again
from rsc_swarm.flight.recorded import Recorded
from rsc_swarm.flight.run_dir import RunDir
from world.outlets.judged import findings_of
from world.outlets.picture import COLUMNS, FARTHEST_M, FLYING, LOST, Picture, picture, scene_of
from world.outlets.trajectory import Trajectory
from world.referee import Findings

_EVERY = 4  # ticks from picture to picture


@dataclass(frozen=True)
class Replay:
    """A flight to be shown. scene: world.outlets.picture.scene. report: of its run directory, if there is one. recorded: why it
    is shown as it was recorded, without radio and beliefs; None if it was flown again."""

    scene: dict[str, Any]
    pictures: list[bytes]
    report: dict[str, Any] | None
    recorded: str | None


def replay_of(folder: RunDir, progress: Callable[[float], None] = lambda share: None) -> Replay:
    """The flight in a run directory. ``progress``: told the share that has been flown again.

    Raises:
        rsc_swarm.flight.run_dir.RunDirError, protocols.mission.document.MissionError, world.outlets.trajectory.TrajectoryError:
            there is none.
    """
    recorded = Recorded.load(folder)
    mission, path = recorded.mission, recorded.path
    told = recorded.told
    report = json.loads(told, parse_float=_finite, parse_constant=_finite) if told else None
    ticks = len(path.positions) - 1
    scene = scene_of(mission, path.obstacles, path.goal_x) | {"ticks": ticks}
    pictures, why = _again(mission, report, ticks, progress)
    return Replay(scene, pictures or recorded_pictures(path, mission), report, None if pictures else why)


def _finite(text: str) -> float | None:
    """A number as a page can read it: its JSON knows no others."""
    number = float(text)
    return number if isfinite(number) else None


def _again(
    mission: Mission, report: dict[str, Any] | None, ticks: int, progress: Callable[[float], None]
) -> tuple[list[bytes], str]:
    """The pictures of the flight flown again, if it is the same; else none, and why."""
    if report is None:
        return [], "it has no report to be held against"
    if "digest" not in report:
        return [], "it was flown on the air, which nobody flies again"
    pictures = []
    try:
        for director in fly_again(mission, report.get("clock", ""), ticks, report["digest"]):
            over = director.clock >= ticks or not director.core.active[0]
            if director.clock % _EVERY == 0 or over:
                pictures.append(
                    picture(director.core, director.statuses, 0.0, plans=director.plans()).packed()
                )
                progress(director.clock / max(ticks, 1))
    except SwarmError as error:
        return [], str(error)
    return pictures, ""


def recorded_pictures(path: Trajectory, mission: Mission) -> list[bytes]:
    """A recorded flight as far as its paths tell."""
    findings = findings_of(path, mission)
    rows = sorted({*range(0, len(path.positions), _EVERY), len(path.positions) - 1})
    return [recorded_picture(path, findings, row).packed() for row in rows]


def recorded_picture(path: Trajectory, findings: Findings, row: int) -> Picture:
    """One row of a recording; ``findings``: the referee's, on all rows."""
    drones = np.zeros((path.positions.shape[1], len(COLUMNS)), np.float32)
    drones[:, 0:2], drones[:, 2:4], drones[:, 4] = path.positions[row], path.velocities[row], path.slots[row]
    drones[:, 5] = np.where(path.flying[row], FLYING, LOST)
    drones[:, 6] = np.minimum(findings.nearest[row], FARTHEST_M)
    drones[:, 7] = findings.edge_error[row]
    nothing = np.empty((0, 3), np.int16)
    return Picture(row, 0.0, drones, nothing, nothing, {}, {})
