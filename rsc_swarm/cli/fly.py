"""A flight as a command: fly with a live view, then tell what came of it."""

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

from protocols.errors import ExitCode
from protocols.mission.document import Mission
from protocols.whole_file import WriteError
from rsc_swarm.cli.options import Clock, MissionOptions, command_line, resolve
from rsc_swarm.cli.output import JsonOutput
from rsc_swarm.flight.processes import leave_when_asked
from rsc_swarm.flight.run_dir import RunDir
from rsc_swarm.show.render import plain, render, show
from rsc_swarm.show.report import FlightReport, agents_text, report_of
from rsc_swarm.show.view import View, line
from world.outcome import Flown


class Flight(NamedTuple):
    """What is to be flown, and who is told meanwhile."""

    mission: Mission
    clock: Clock
    view: View
    folder: RunDir | None


class Told(NamedTuple):
    """What a flight tells: its figures, and those only a launcher knows. ``unsaved``: why its paths could not be saved."""

    flown: Flown
    first_tick_s: float | None = None
    pss_mb: float | None = None
    unsaved: str | None = None


def fly_once(
    mode: Literal["simulate", "launch", "world"],
    fly: Callable[[Flight], Told],
    options: MissionOptions,
    clock: Clock,
    json: str | None,
    run_dir: Path | None,
    also: Mapping[str, Any] | None = None,
) -> ExitCode:
    """Fly once; how the command ends. ``also``: the options that flying it again needs besides those of the mission.

    Raises:
        protocols.errors.SwarmError: the mission cannot be flown, or the run itself broke.
    """
    mission = resolve(options)
    output = JsonOutput(json)
    folder = RunDir(run_dir) if run_dir else None
    if folder:
        folder.begin(mission)
    who = f"{agents_text(mission.agents)}, policy {mission.policy}"
    view = View(f"{mode} {mission.name}: {who}, map {mission.map_seed}, seed {mission.seed}")
    try:
        with view:
            told = fly(Flight(mission, clock, view, folder))
    except KeyboardInterrupt:
        reached = f"stopped at {line(view.last)}" if view.last else "stopped before the first tick"
        print(reached, file=sys.stderr)
        return ExitCode.INTERRUPTED
    with (
        leave_when_asked()
    ):  # who pressed Ctrl-C once may press it again: what was flown is told and kept all the same
        realtime = {} if clock is Clock.lockstep else {"clock": clock.value}
        again = command_line(mode, options, **(also or {}), **realtime)
        report = report_of(told.flown, mission, mode, clock.value, again, told.first_tick_s, told.pss_mb)
        output.write(report.model_dump_json(indent=2))
        show(render(report), output.beside)
        if folder:  # last, because its disk may be full
            folder.finish(report, plain(render(report)))
    if told.unsaved:
        raise WriteError(told.unsaved)
    return _ends(report)


def _ends(report: FlightReport) -> ExitCode:
    if report.failure == "interrupted":
        return ExitCode.INTERRUPTED
    return ExitCode.SUCCEEDED if report.success else ExitCode.FAILED
