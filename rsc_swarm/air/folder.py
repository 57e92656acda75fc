"""The run directory of flights on the air: one for each flight, 1, 2, ..., as a launch makes it (rsc_swarm.flight.run_dir)."""

import json
import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from agent.air.log import FlightLog
from protocols.dynamics import TICK_S
from protocols.fleet.plan import Plan
from protocols.whole_file import write_whole
from rsc_swarm.air.judged import Judged, judged, path_of
from rsc_swarm.flight.events import End, events_of, json_lines
from rsc_swarm.flight.run_dir import RunDir, RunDirError


def check_folder(path: Path) -> None:
    """Before anything flies, for a flight is not flown again.

    Raises:
        rsc_swarm.flight.run_dir.RunDirError: nothing can be kept in ``path``.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise RunDirError(
            f"--run-dir {path}: {error.strerror}; give a directory that can be written"
        ) from None


def next_folder(path: Path) -> RunDir:
    """The directory of the next flight in ``path``."""
    number = 1
    while (path / str(number)).exists():
        number += 1
    return RunDir(path / str(number))


def keep(folder: RunDir, plan: Plan, log: FlightLog, events: Sequence[dict[str, Any]], **told: Any) -> Judged:
    """Write a flight that is over into its directory; how it went.

    Args:
        events: what happened, each with ``utc_s``. told: more for the report.

    Raises:
        rsc_swarm.flight.run_dir.RunDirError, protocols.whole_file.WriteError: it cannot be written.
    """
    path = path_of(plan, log)
    outcome = judged(plan, path)
    folder.begin(plan.mission)
    path.save(folder.trajectory)
    end = End(outcome.failure, f"over: {outcome.failure or 'in formation beyond the goal line'}")
    happened = events_of(path.until(plan.ticks + 1), plan.mission, end)
    write_whole(folder.events, json_lines(happened))
    report = {
        "success": outcome.failure is None,
        "time_s": plan.ticks * TICK_S if outcome.tau_s is None else outcome.tau_s,
        "detail": end.text,
        **asdict(outcome), "where": "air", "scale": plan.fleet.scale, **told, "events": list(events),
    }  # fmt: skip
    write_whole(folder.report, json.dumps(report, indent=2) + "\n")
    lines = [f"{event['utc_s']:.2f} {event['drone']} {event['phase']}: {event['why']}" for event in events]
    write_whole(folder.logs / "events.txt", "\n".join([*lines, ""]))
    return outcome


def event_of(drone: int, utc_s: float, phase: str, reasons: Sequence[str]) -> dict[str, Any]:
    """A change of phase, as the report has it."""
    return {"utc_s": round(utc_s, 3), "drone": drone, "phase": phase, "why": "; ".join(reasons)}
