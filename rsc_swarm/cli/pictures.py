"""What ``rsc-swarm plot`` draws: find or fly what is to be seen, then draw it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import MappingProxyType

from protocols.mission.document import Mission
from rsc_swarm.cli.output import check_place
from rsc_swarm.flight.events import end_of
from rsc_swarm.flight.recorded import Recorded
from rsc_swarm.flight.run_dir import RunDir
from rsc_swarm.options import MissionOptions, chosen, flag, resolve
from rsc_swarm.show.plots.curves import draw_curves, draw_horizons
from rsc_swarm.show.plots.film import Film, film
from rsc_swarm.show.plots.flight import draw
from rsc_swarm.show.plots.letter import draw_letter
from rsc_swarm.show.plots.style import PlotError
from rsc_swarm.show.progress import Meter
from world.outlets.recorder import Recorder


@dataclass(frozen=True)
class Subject:
    """What is to be drawn; nothing given: the flight of the mission options."""

    run_dir: Path | None = None
    compare: str | None = None
    horizons: Path | None = None
    letter: Path | None = None
    curve: Sequence[Path] = ()

    @property
    def given(self) -> list[str]:
        """The options given, as one writes them."""
        return [flag(entry.name) for entry in fields(self) if getattr(self, entry.name) not in (None, ())]


def several_asked(*given: str) -> PlotError:
    """Who asks for these asks for more than one picture."""
    return PlotError(f"{' '.join(given)}: these are different pictures; give one")


def make(
    options: MissionOptions,
    out: Path | None,
    subject: Subject,
    films: Mapping[Film, Path] = MappingProxyType({}),
) -> None:
    """Draw ``subject`` into ``out``, and make ``films`` of it; of films alone no picture is drawn unless ``out`` is given.

    Raises:
        PlotError, MissionError, RunDirError, TrajectoryError, WriteError, rsc_swarm.study.tables.result.TableError: one line
            says what is wrong.
    """
    if len(subject.given) > 1:
        raise several_asked(*subject.given)
    others = [flag(name) for name in chosen(options)]
    if others and subject.given and subject.compare is None:
        raise PlotError(
            f"{' '.join(others)}: {subject.given[0]} draws what was flown already; give the one or the other"
        )
    kind = "flight" if subject.run_dir or not subject.given else subject.given[0].removeprefix("--")
    picture = out or (None if films else Path(f"{kind}.png"))
    files = [*films.items(), *([("out", picture)] if picture else [])]
    for name, file in files:
        check_place(f"--{name}", file)
        if name != "out" and file.suffix.lower() not in ("", f".{name}"):
            raise PlotError(f"--{name} {file}: give a file that ends in .{name}")
    if films and subject.given and not subject.run_dir:
        raise PlotError(f"--{next(iter(films))}: a film shows one flight; leave {subject.given[0]} out")
    if films:
        _show(
            Recorded.load(RunDir(subject.run_dir)) if subject.run_dir else _flown(resolve(options)),
            picture,
            films,
        )
    elif picture:
        print(f"{picture}: {_draw(options, picture, subject)}")


def _show(track: Recorded, picture: Path | None, films: Mapping[Film, Path]) -> None:
    """The films of a flight, and its picture."""
    if picture:
        draw([track], picture)
        print(f"{picture}: {track.verdict}")
    for kind, out in films.items():
        meter = Meter()
        meter.begin(f"{out}: drawing")

        def draw_more(done: int, total: int, meter: Meter = meter, out: Path = out) -> None:
            if meter.due():
                meter.draw(done / total, f"{out}: picture {done} of {total}")

        try:
            film(track, out, kind, draw_more)
        finally:
            meter.close()
        print(f"{out}: {track.verdict}")


def _draw(options: MissionOptions, out: Path, subject: Subject) -> str:
    """Draw, and say in a few words what."""
    for table, drawing, said in (
        (subject.horizons, draw_horizons, "success against horizon"),
        (subject.letter, draw_letter, "from the letter to ours"),
    ):
        if table:
            from rsc_swarm.study.tables.result import read_table

            drawing(read_table(table), out)
            return said
    if subject.curve:
        draw_curves(subject.curve, out)
        return f"{len(subject.curve)} training{'s' if len(subject.curve) > 1 else ''}"
    if subject.run_dir:
        tracks = [Recorded.load(RunDir(subject.run_dir))]
    elif subject.compare is not None:
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


def _flown(mission: Mission) -> Recorded:
    from rsc_swarm.flight.in_process import fly

    recorder = Recorder(mission)
    flown = fly(mission, recorder=recorder)
    return Recorded(mission, recorder.trajectory, end_of(flown, mission), flown.outcome.tau_s)
