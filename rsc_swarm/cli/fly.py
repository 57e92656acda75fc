"""``rsc-swarm simulate``, ``launch`` and ``world``: fly once with a live view, then tell what came of it."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Literal, NamedTuple

from protocols.mission.document import Mission, MissionError
from rsc_swarm.cli.options import Clock, MissionOptions, command_line, resolve
from rsc_swarm.flight.run_dir import RunDir, write_whole
from rsc_swarm.show.render import plain, render, show
from rsc_swarm.show.report import FlightReport, agents_text, report_of
from rsc_swarm.show.view import View, line
from world.server.session import Flown

_SUCCEEDED, _FAILED, _INTERRUPTED = 0, 1, 130


class _Told(NamedTuple):
    """What a flight tells: its figures, and those only a launcher knows."""

    flown: Flown
    first_tick_s: float | None = None
    pss_mb: float | None = None


_Fly = Callable[[View, RunDir | None], _Told]


def simulate(options: MissionOptions, clock: Clock, json: str | None, run_dir: Path | None) -> int:
    """Fly in this process; the exit code.

    Raises:
        MissionError, agent.policy.PolicyError, world.field.FieldError, RunDirError: it cannot be flown.
    """
    from rsc_swarm.flight.in_process import fly

    mission = resolve(options)

    def flight(view: View, folder: RunDir | None) -> _Told:
        trajectory = folder.trajectory if folder else None
        return _Told(fly(mission, clock is Clock.realtime, view.update, trajectory))

    return _fly_once("simulate", flight, mission, options, clock, json, run_dir)


def launch(options: MissionOptions, clock: Clock, json: str | None, run_dir: Path | None) -> int:
    """Fly in real processes; the exit code.

    Raises:
        rsc_swarm.flight.launch.RunBroken: the run itself broke. Else as simulate.
    """
    from rsc_swarm.flight import launch as launcher

    mission = resolve(options)

    def flight(view: View, folder: RunDir | None) -> _Told:
        place = folder.path if folder else None
        launched = launcher.launch(mission, clock.value, place, view.update, weigh=True)
        return _Told(launched.flown, launched.first_tick_s, launched.pss_mb)

    return _fly_once("launch", flight, mission, options, clock, json, run_dir)


def world(
    options: MissionOptions,
    listen: list[str],
    credentials: Path,
    clock: Clock,
    json: str | None,
    run_dir: Path | None,
    join_s: float,
) -> int:
    """Be the world for drones that are started elsewhere; the exit code.

    Raises:
        rsc_swarm.flight.launch.RunBroken: it cannot listen there, or drones did not come. Else as simulate.
    """
    from rsc_swarm.flight import launch as launcher
    from world.outlets.recorder import Recorder

    mission = resolve(options)

    def flight(view: View, folder: RunDir | None) -> _Told:
        recorder = Recorder(mission)
        view.say(
            f"waiting for {mission.agents} agents at {', '.join(listen)}; credentials are in {credentials}"
        )
        flown = launcher.serve_world(
            mission, clock.value, listen, credentials, view.update, recorder.record, join_s
        )
        if folder:
            recorder.save(folder.trajectory)
        return _Told(flown)

    return _fly_once("launch", flight, mission, options, clock, json, run_dir)


def _fly_once(
    mode: Literal["launch", "simulate"],
    fly: _Fly,
    mission: Mission,
    options: MissionOptions,
    clock: Clock,
    json: str | None,
    run_dir: Path | None,
) -> int:
    check_json(json)
    folder = RunDir(run_dir) if run_dir else None
    if folder:
        folder.begin(mission)
    who = f"{agents_text(mission.agents)}, policy {mission.policy}"
    view = View(f"{mode} {mission.name}: {who}, map {mission.map_seed}, seed {mission.seed}")
    try:
        with view:
            told = fly(view, folder)
    except KeyboardInterrupt:
        print(
            f"stopped at {line(view.last)}" if view.last else "stopped before the first tick", file=sys.stderr
        )
        return _INTERRUPTED
    realtime = {} if clock is Clock.lockstep else {"clock": clock.value}
    again = command_line(mode, options, **realtime)
    report = report_of(told.flown, mission, mode, clock.value, again, told.first_tick_s, told.pss_mb)
    if folder:
        folder.finish(report, plain(render(report)))
    if json == "-":
        print(report.model_dump_json(indent=2))
    elif json:
        write_whole(Path(json), report.model_dump_json(indent=2) + "\n")
    show(render(report), sys.stderr if json == "-" else sys.stdout)
    return _code(report)


def _code(report: FlightReport) -> int:
    if report.failure == "interrupted":
        return _INTERRUPTED
    return _SUCCEEDED if report.success else _FAILED


def check_json(json: str | None) -> None:
    """Refuse a ``--json`` that could not be written, before anything is flown.

    Raises:
        MissionError: it names no file in a directory that exists.
    """
    if json in (None, "-"):
        return
    path = Path(json).absolute()
    if path.is_dir() or not path.parent.is_dir():
        raise MissionError(f"--json {json}: give a file in a directory that exists, or - for stdout")
