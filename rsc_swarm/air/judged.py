"""What came of a flight on the air, judged as any other: by the world's referee, from what was heard of all positions."""

from dataclasses import dataclass

import numpy as np

from agent.air.log import FlightLog
from protocols.dynamics import TICK_S
from protocols.fleet.plan import Plan
from world.outlets.judged import findings_of
from world.outlets.trajectory import Trajectory


@dataclass(frozen=True)
class Judged:
    """In the room's metres. tau_s: when the formation first stood behind the goal line. slot_error_m: at the mission's end."""

    tau_s: float | None
    failure: str | None
    closest_m: float
    slot_error_m: float | None


def path_of(plan: Plan, log: FlightLog) -> Trajectory:
    """A log as a recording, in the mission's frame."""
    kept = slice(log.rows)
    obstacles = np.array(plan.mission_obstacles, float).reshape(-1, 3)
    return Trajectory(
        log.positions[kept], log.velocities[kept], log.slots[kept], log.flying[kept], obstacles, plan.goal_x_m, TICK_S
    )  # fmt: skip


def judged(plan: Plan, path: Trajectory) -> Judged:
    """How the flight of ``path`` went, until its mission was over."""
    rows = min(len(path.positions), plan.ticks + 1)
    if rows == 0:
        return Judged(None, "interrupted", float("inf"), None)
    findings = findings_of(path.until(rows), plan.mission)
    verdict, scale = findings.verdict, plan.fleet.scale
    formed, collided = np.flatnonzero(verdict["formed"]), bool(verdict["collided"].any())
    tau_s = float(formed[0]) * TICK_S if len(formed) else None
    failure = "collision" if collided else None if tau_s is not None else "late"
    whole = rows > plan.ticks
    return Judged(
        None if collided else tau_s,
        failure,
        scale * float(min(verdict["closest_agents_m"].min(), verdict["closest_obstacle_m"].min())),
        scale * float(verdict["slot_error_m"][plan.ticks]) if whole else None,
    )


def rehearse_judging(plan: Plan) -> None:
    """Load what judging needs, so that whoever lands first holds up nobody who still flies."""
    log = FlightLog(plan)
    log.record(0, {}, 0.0)
    judged(plan, path_of(plan, log))
