"""The public door: what ``import rsc_swarm as rs`` offers. Every name is told in docs/api.md.

Missions are frozen documents; a flight is a function of its mission, so whatever is flown here has the digest that
``rsc-swarm simulate`` and ``rsc-swarm launch`` have for it. Metres, seconds; x forward, y left.
"""

import os
import shlex
import subprocess
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, overload

from agent.policy import Policy, PolicyError, Seen
from protocols.errors import ExitCode, SwarmError
from protocols.mission.document import Mission, MissionError, parse_mission, read_mission_fields
from protocols.mission.findings import shown
from protocols.mission.policy_name import from_folder, named_by, split
from protocols.mission.reading import write_value
from rsc_swarm.errors import NAMED, error_of
from rsc_swarm.flight.events import Event, end_told, events_of
from rsc_swarm.flight.in_process import fly_in_step
from rsc_swarm.flight.launch import RunBroken
from rsc_swarm.flight.recorded import Recorded
from rsc_swarm.flight.report import FlightReport, report_of
from rsc_swarm.flight.simulate import flights_at_once
from rsc_swarm.given import A_MISSION, a_mission, a_path, one_of, one_or_several, plain, whole
from rsc_swarm.missions import mission_file
from rsc_swarm.show.plots.flight import draw as draw_tracks
from rsc_swarm.study import evaluate as study
from rsc_swarm.study.evaluate import Evaluation
from rsc_swarm.study.fingerprint import fingerprint
from rsc_swarm.study.machines import Who, crew_of
from world.outlets.recorder import Recorder
from world.outlets.trajectory import Trajectory

__all__ = [
    "Evaluation",
    "Event",
    "Flight",
    "FlightReport",
    "Mission",
    "MissionError",
    "Policy",
    "PolicyError",
    "RunBroken",
    "Seen",
    "SwarmError",
    "Trajectory",
    "draw",
    "evaluate",
    "launch",
    "mission",
    "simulate",
    "write_report",
]

_A_FLIGHT = "a Flight, as simulate and launch return it"
_FLOWN = (ExitCode.SUCCEEDED, ExitCode.FAILED)  # a launch that came to its end
_LEAVE_S = 5.0  # for a command that has heard Ctrl-C; then it is asked


@dataclass(frozen=True)
class Flight:
    """One flight: what was flown, what came of it, and every drone's path."""

    mission: Mission
    report: FlightReport
    trajectory: Trajectory

    @property
    def events(self) -> list[Event]:
        """What happened, in order (docs/recordings.md); computed anew each time."""
        return events_of(self.trajectory, self.mission, end_told(self.report))


def mission(source: str | Path | Mission | None = None, /, **fields: Any) -> Mission:
    """A mission: the standard task, or the one in ``source``, with ``fields`` on top.

    Args:
        source: a mission file, the name of a mission that comes with the project, or a mission to begin with.
        fields: fields of docs/missions.md; those of a section as a dictionary, which leaves the section's others as they
            are: ``radio={"loss": 0.2}``. ``policy`` may also be a class (docs/policies.md).

    Raises:
        MissionError: it cannot be flown; one line names the field and what would be right.
    """
    document: dict[str, Any] = {}
    if isinstance(source, Mission):
        document = source.model_dump(exclude_unset=True)
    elif isinstance(source, str | Path):
        document = read_mission_fields(mission_file(str(source)))
    elif source is not None:
        raise MissionError(f"mission: give a file, a name or fields such as agents=25, not {shown(source)}")
    if isinstance(fields.get("policy"), type):
        fields["policy"] = _name_of(fields["policy"])
    named = str(source) if isinstance(source, str | Path) else "mission"
    return parse_mission(_merged(document, plain(fields)), named)


def _merged(under: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    merged = dict(under)
    for name, value in over.items():
        below = merged.get(name)
        merged[name] = _merged(below, value) if isinstance(below, dict) and isinstance(value, dict) else value
    return merged


def _name_of(policy: type) -> str:
    """The name by which a flight finds this class again: ``module:Class``.

    Raises:
        MissionError: it is not at the top of its module.
    """
    name = f"{policy.__module__}:{policy.__qualname__}"
    if getattr(sys.modules.get(policy.__module__), policy.__qualname__, None) is not policy:
        raise MissionError(
            f"policy: {name} cannot be found by its name; define the class at the top of a module"
        )
    return name


@overload
def simulate(mission: Mission) -> Flight: ...
@overload
def simulate(mission: Iterable[Mission]) -> list[Flight]: ...
def simulate(mission: Mission | Iterable[Mission]) -> Flight | list[Flight]:
    """Fly a mission, or each of several, in this process, as fast as it goes. Those that differ in seeds and obstacles alone are
    flown in step, which is quicker and changes nothing else.

    Raises:
        PolicyError, MissionError, FieldError: it cannot be flown.
    """
    missions = one_or_several("mission", mission, Mission, A_MISSION)
    flights: dict[int, Flight] = {}
    for group in _together(missions):
        recorders = [Recorder(missions[place], world) for world, place in enumerate(group)]
        for place, recorder, flown in zip(
            group, recorders, fly_in_step([missions[place] for place in group], recorders), strict=True
        ):
            one = missions[place]
            report = report_of(flown, one, "simulate", "lockstep", _again("simulate", one))
            flights[place] = Flight(one, report, recorder.trajectory)
    return flights[0] if isinstance(mission, Mission) else [flights[place] for place in range(len(missions))]


def _together(missions: Sequence[Mission]) -> Iterator[list[int]]:
    """The missions by their places, in groups that can be flown in step: they differ in seeds and obstacles alone."""
    alike: dict[str, list[int]] = {}
    for place, one in enumerate(missions):
        alike.setdefault(one.model_dump_json(exclude={"name", "map_seed", "seed", "obstacles"}), []).append(
            place
        )
    for places in alike.values():
        most = flights_at_once(missions[places[0]])
        for first in range(0, len(places), most):
            yield places[first : first + most]


def launch(
    mission: Mission,
    clock: Literal["lockstep", "realtime"] = "lockstep",
    run_dir: str | Path | None = None,
) -> Flight:
    """Fly a mission in real processes: one for the world, one for every drone, and one that starts and watches them.

    That one is new too, so nothing that the caller has open (threads, models, sockets) comes along. Modules are found as in
    the caller; a policy that is defined in a script or notebook itself is not.

    Args:
        clock: repeatable and as fast as it goes, or 100 ticks a second on the wall clock.
        run_dir: keep mission, report, paths and logs in this folder (docs/recordings.md), which must not hold a flight yet.

    Raises:
        MissionError, PolicyError, FieldError: it cannot be flown, or the policy went wrong. RunBroken: the run itself
            broke. rsc_swarm.flight.run_dir.RunDirError: the folder cannot be used. One line says why.
        KeyboardInterrupt: Ctrl-C; all processes have ended.
    """
    if clock not in ("lockstep", "realtime"):
        raise MissionError(f"clock: give 'lockstep' or 'realtime', not {shown(clock)}")
    if a_mission(mission).policy.startswith("__main__:"):
        raise MissionError(
            f"policy: {mission.policy} is defined in the script itself, where drones cannot find it; "
            "put the class into a module of its own and import it"
        )
    with TemporaryDirectory() as temporary:
        folder = Path(temporary) / "run" if run_dir is None else a_path("run_dir", run_dir)
        words = ["launch", *_settings(mission), "--clock", clock]
        ended, said = _command(*words, "--run-dir", str(folder))
        if ended == ExitCode.INTERRUPTED:
            raise KeyboardInterrupt
        kept = folder / "report.json"
        report = (
            FlightReport.model_validate_json(kept.read_text(encoding="utf-8")) if kept.is_file() else None
        )
        if report and report.failure == "broken":
            raise RunBroken(report.detail)
        if ended not in _FLOWN or not report:
            raise error_of(said, ended)
        if run_dir is None:
            report = report.model_copy(update={"again": _again("launch", mission, "--clock", clock)})
        return Flight(mission, report, Trajectory.load(folder / "trajectory.npz"))


def _command(*words: str) -> tuple[int, str]:
    """Run a command of rsc-swarm: how it ended, and what it said of that. Ctrl-C lets it leave in order first."""
    paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
    with subprocess.Popen(
        [sys.executable, "-m", "rsc_swarm", *words],
        env={**os.environ, **NAMED, "PYTHONPATH": paths},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as command:
        try:
            return _end_of(command, None)
        except KeyboardInterrupt:
            try:
                _end_of(command, _LEAVE_S)
            except subprocess.TimeoutExpired:  # it was meant for this process alone
                command.terminate()
                _end_of(command, None)
            raise
        finally:
            if command.poll() is None:  # asked twice, or by something else than Ctrl-C
                command.terminate()


def _end_of(command: "subprocess.Popen[str]", within_s: float | None) -> tuple[int, str]:
    _, said = command.communicate(timeout=within_s)
    return command.returncode, said


def _again(verb: str, mission: Mission, *more: str) -> str:
    """The command that flies this mission again, in any folder."""
    anywhere = mission.model_copy(update={"policy": _anywhere(mission.policy)})
    return shlex.join(["rsc-swarm", verb, *_settings(anywhere), *more])


def _anywhere(policy: str) -> str:
    """The policy by a name that finds it in any folder: one in a module that is not installed by its file."""
    place, name = split(policy)
    file = getattr(sys.modules.get(place), "__file__", None) if name else None
    if file and "." not in place and not Path(file).is_relative_to(sysconfig.get_path("purelib")):
        return named_by(policy, file)
    return from_folder(policy, Path.cwd())


def _settings(mission: Mission) -> list[str]:
    """The options that make this mission of the standard task."""
    words = []
    for field, value in _leaves(mission.model_dump(mode="json", exclude_defaults=True)):
        words += ["--set", f"{field}={write_value(value)}"]
    return words


def _leaves(fields: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Every field by its dotted name."""
    for name, value in fields.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{prefix}{name}.")
        else:
            yield prefix + name, value


def evaluate(
    mission: Mission,
    maps: int = 200,
    starts: int = 3,
    seed_base: int = 0,
    workers: int | None = None,
    on: str | None = None,
) -> Evaluation:
    """Fly a mission on many maps, from several starts each, and add the flights up: a row of a table.

    Args:
        maps: map seeds ``seed_base`` to ``seed_base + maps - 1``. Tune on 1,000,000 and up, measure on 0 to 199.
        starts: start k of map m flies with seed 1000 m + k.
        workers: processes that fly; None: one per processor.
        on: fly on Dask workers instead: ``local:4``, or ``tcp://host:8786`` (docs/machines.md).

    Raises:
        MissionError, PolicyError, FieldError: it cannot be flown.
        WorkerError: a worker died. rsc_swarm.study.machines.MachinesError: nobody to fly on.
    """
    maps, starts, seed_base = whole("maps", maps), whole("starts", starts), whole("seed_base", seed_base)
    who = Who(None if workers is None else whole("workers", workers), None if on is None else str(on))
    a_mission(mission)
    with crew_of(who) as crew:
        flights = study.evaluate(mission, study.seeds_of(seed_base, maps, starts), crew)
    return study.summarise(mission, flights, starts, fingerprint(mission))


def draw(flights: Flight | Sequence[Flight], out: str | Path) -> None:
    """Draw flights, seen from above, one below the other and to the same scale, into the file ``out`` (.png, .svg, .pdf).

    Raises:
        rsc_swarm.show.plots.style.PlotError: matplotlib is missing (``pip install matplotlib``), or knows no such files.
        protocols.whole_file.WriteError: it cannot be written. MissionError: these are no flights, or no path.
    """
    several = one_or_several("flights", flights, Flight, _A_FLIGHT)
    if not several:
        raise MissionError("flights: give at least one")
    draw_tracks([_track(flight) for flight in several], a_path("out", out))


def write_report(flight: Flight, out: str | Path) -> None:
    """Write the story of a flight as one HTML file (docs/recordings.md).

    Raises:
        protocols.whole_file.WriteError: it cannot be written. MissionError: this is no flight, or no path.
    """
    one_of("flight", flight, Flight, _A_FLIGHT)
    from rsc_swarm.show.page.page import write_page  # what few need is loaded by those

    write_page(_track(flight), a_path("out", out))


def _track(flight: Flight) -> Recorded:
    report = flight.report
    return Recorded(flight.mission, flight.trajectory, end_told(report), report.tau_s, report)
