"""What ``rsc-swarm plot`` draws: find or fly what is to be seen, then draw it."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

from protocols.mission.document import Mission, parse_mission, read_mission_fields
from rsc_swarm.flight.run_dir import RunDir
from rsc_swarm.options import MissionOptions, chosen, flag, resolve
from rsc_swarm.show.plots.curves import draw_curves, draw_horizons
from rsc_swarm.show.plots.flight import Track, draw
from rsc_swarm.show.plots.style import PlotError
from world.outlets.recorder import Recorder
from world.outlets.trajectory import Trajectory


@dataclass(frozen=True)
class Subject:
    """What is to be drawn; nothing given: the flight of the mission options."""

    run_dir: Path | None = None
    compare: str | None = None
    horizons: Path | None = None
    curve: Sequence[Path] = ()

    @property
    def given(self) -> list[str]:
        """The options given, as one writes them."""
        return [flag(entry.name) for entry in fields(self) if getattr(self, entry.name)]


def run(options: MissionOptions, out: Path | None, subject: Subject) -> None:
    """Draw ``subject`` into ``out``.

    Raises:
        PlotError, MissionError, RunDirError, rsc_swarm.study.tables.result.TableError: one line says what is wrong.
    """
    if len(subject.given) > 1:
        raise PlotError(f"{' '.join(subject.given)}: these are different pictures; give one")
    others = [flag(name) for name in chosen(options)]
    if others and subject.given and not subject.compare:
        raise PlotError(
            f"{' '.join(others)}: {subject.given[0]} draws what was flown already; give the one or the other"
        )
    out = out or Path(f"{subject.given[0].removeprefix('--')}.png" if subject.given else "flight.png")
    if out.is_dir() or not out.absolute().parent.is_dir():
        raise PlotError(f"--out {out}: give a file in a directory that exists")
    print(f"{out}: {_draw(options, out, subject)}")


def _draw(options: MissionOptions, out: Path, subject: Subject) -> str:
    """Draw, and say in a few words what."""
    if subject.horizons:
        from rsc_swarm.study.tables.result import read_table

        draw_horizons(read_table(subject.horizons), out)
        return "success against horizon"
    if subject.curve:
        draw_curves(subject.curve, out)
        return f"{len(subject.curve)} training{'s' if len(subject.curve) > 1 else ''}"
    if subject.run_dir:
        tracks = [_recorded(RunDir(subject.run_dir))]
    elif subject.compare:
        tracks = [_flown(mission) for mission in _sizes(options, subject.compare)]
    else:
        tracks = [_flown(resolve(options))]
    draw(tracks, out)
    return "; ".join(track.verdict for track in tracks)


def _sizes(options: MissionOptions, compare: str) -> list[Mission]:
    """The mission of ``options`` for each number of drones in ``compare``."""
    if options.agents is not None:
        raise PlotError("--agents: --compare says how many drones fly; give the one or the other")
    try:
        sizes = [int(text) for text in compare.split(",")]
    except ValueError:
        raise PlotError(
            f"--compare {compare}: write numbers of drones, for example --compare 25,36"
        ) from None
    return [resolve(replace(options, agents=size)) for size in sizes]


def _flown(mission: Mission) -> Track:
    from rsc_swarm.flight.in_process import fly

    recorder = Recorder(mission)
    outcome = fly(mission, recorder=recorder).outcome
    return Track(mission, recorder.trajectory, outcome.tau_s, outcome.failure)


def _recorded(folder: RunDir) -> Track:
    folder.check()
    mission = parse_mission(read_mission_fields(folder.mission), str(folder.mission))
    ended = folder.ended()
    return Track(mission, Trajectory.load(folder.trajectory), ended.tau_s, ended.failure)
