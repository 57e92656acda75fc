"""A flight as a command: fly with a live view, then tell what came of it.

What makes the report of it, and prints it, is loaded when it is needed: the first tick of a launch does not wait for that.
"""

import sys
from collections.abc import Callable, Mapping
from contextlib import ExitStack, contextmanager, redirect_stdout
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from protocols.errors import ExitCode, SwarmError
from protocols.mission.document import Mission
from protocols.whole_file import WriteError, keep_all
from rsc_swarm.cli.app import Clock, FlightOptions
from rsc_swarm.cli.mcap_output import McapOutput
from rsc_swarm.cli.output import JsonOutput
from rsc_swarm.errors import line_of
from rsc_swarm.flight.policy_facts import policy_facts
from rsc_swarm.flight.provenance import ask_ahead, provenance
from rsc_swarm.flight.warm_up import warm_up
from rsc_swarm.flight.words import agents_text
from rsc_swarm.machine.leaving import leave_when_asked
from rsc_swarm.options import MissionOptions, command_line, resolve, with_faults
from rsc_swarm.show.line import line
from rsc_swarm.show.view import View
from world.outcome import Flown
from world.outlets.onlooker import Onlooker

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rsc_swarm.flight.report import FlightReport
    from rsc_swarm.flight.run_dir import RunDir
    from rsc_swarm.watch.window import Window


class Flight(NamedTuple):
    """What is to be flown, and who is told meanwhile. keep: keeps what was flown, for who outlives the command. onlooker: the
    live page, or nobody. folder: where it is recorded. gathered: to be told how many drones are ready."""

    mission: Mission
    clock: Clock
    view: View
    folder: "RunDir | None"
    keep: Callable[[Flown], object]
    onlooker: Onlooker | None
    gathered: Callable[[int], None]


class Told(NamedTuple):
    """What a flight tells: its figures, and those only a launcher knows. save: puts the paths into the run directory, or
    raises the WriteError of whoever tried. error: what broke the run in mid-flight."""

    flown: Flown
    first_tick_s: float | None = None
    pss_mb: float | None = None
    save: Callable[[], None] = lambda: None
    error: SwarmError | None = None


def told_unsaved(why: str | None) -> None:
    """What a world in a process of its own says of its saving.

    Raises:
        protocols.whole_file.WriteError: it could not, and said why.
    """
    if why:
        raise WriteError(why)


def fly_once(
    mode: Literal["simulate", "launch", "world"],
    fly: Callable[[Flight], Told],
    asked: FlightOptions,
    options: MissionOptions,
    also: Mapping[str, Any] | None = None,
    given: Mission | None = None,
) -> ExitCode:
    """Fly once; how the command ends. ``also``: the options that flying it again needs besides those of the mission.
    ``given``: what is flown, where ``options`` are but a part of that.

    What came of it is told before anything is kept, so that a full disk loses no more than it must.

    Raises:
        protocols.errors.SwarmError: the mission cannot be flown, or the run itself broke.
    """
    ask_ahead()
    mission = given or resolve(options)
    output, mcap = JsonOutput(asked.json), McapOutput(asked.mcap)
    with redirect_stdout(output.beside):  # whatever a policy prints
        policy_files = policy_facts(mission).files
    flown_with = provenance(policy_files)
    folder = None
    if asked.run_dir:
        from rsc_swarm.flight.run_dir import RunDir

        folder = RunDir(asked.run_dir)
        folder.begin(mission, policy_files, asked.overwrite)
        options = options if given else MissionOptions(mission=str(folder.mission))
    realtime = {} if asked.clock is Clock.lockstep else {"clock": asked.clock.value}
    who = f"{agents_text(mission.agents)}, policy {mission.policy}"
    view = View(f"{mode} {mission.name}: {who}, map {mission.map_seed}, seed {mission.seed}")

    def flown_task(told: Told) -> Mission:
        return mission.model_copy(update={"faults": (*mission.faults, *told.flown.by_hand)})

    def report(told: Told) -> "FlightReport":
        from rsc_swarm.flight.report import report_of

        figures = (told.first_tick_s, told.pss_mb, flown_with)
        task, asked_again = flown_task(told), options
        if told.flown.by_hand and not folder:
            asked_again = with_faults(options, task.faults)
        again = command_line(mode, asked_again, **(also or {}), **realtime)
        made = report_of(told.flown, task, mode, asked.clock.value, again, *figures)
        return made.model_copy(update={"detail": f"{made.detail}; {told.error}"}) if told.error else made

    def keep(told: Told, *first: Callable[[], None]) -> list[SwarmError]:
        """Keep it, but do ``first`` first; what went wrong."""
        from rsc_swarm.show.render import plain, render

        kept = report(told)
        saves: list[Callable[[], object]] = [*first, partial(output.write, kept.model_dump_json(indent=2))]
        if folder:
            saves.append(partial(folder.add_faults, told.flown.by_hand))
        saves.append(told.save)
        if folder:
            saves.append(partial(folder.finish, kept, plain(render(kept))))
        saves.append(partial(mcap.write, place, flown_task(told), kept))
        try:
            keep_all(*saves)
        except WriteError as error:
            return [error]
        return []

    def gathered(ready: int) -> None:
        view.waiting(ready, mission.agents)
        if window:
            window.say({"kind": "gathered", "ready": ready, "drones": mission.agents})

    with ExitStack() as asking:
        place = asking.enter_context(mcap.place(folder))
        window = asking.enter_context(_served(mode, asked, view))
        try:
            with view, redirect_stdout(output.beside):
                warm_up(mission)  # who leaves before this is done has nothing to lose
                # From now on what was flown is told and kept, however often somebody presses Ctrl-C.
                asking.enter_context(leave_when_asked())
                outlives = (lambda flown: keep(Told(flown)), window, gathered)
                told = fly(Flight(mission, asked.clock, view, place, *outlives))
        except KeyboardInterrupt:
            reached = f"stopped at {line(view.last)}" if view.last else "stopped before the first tick"
            print(reached, file=sys.stderr)
            return ExitCode.INTERRUPTED
        from rsc_swarm.show.render import plain, render, show

        flown = report(told)
        if window:
            window.say(
                {"kind": "report", "report": flown.model_dump(mode="json"), "text": plain(render(flown))}
            )
        errors = [told.error] if told.error else []
        errors += keep(told, partial(show, render(flown), output.beside))
    if errors:
        print(line_of(errors[0], "; ".join(map(str, errors))), file=sys.stderr)
        return errors[0].exit_code
    return _ends(flown)


@contextmanager
def _served(mode: str, asked: FlightOptions, view: View) -> "Iterator[Window | None]":
    """The window of a live page, if one is wanted."""
    if not (asked.view or asked.open):
        yield None
        return
    from rsc_swarm.watch.site import Asked, served

    # A simulation is over in less time than a browser needs to open: it flies as fast as one can watch.
    paced = asked.clock is Clock.lockstep
    speed = 1.0 if mode == "simulate" and paced else None
    with served(Asked(asked.view_host, asked.view_port, asked.open), speed, paced) as site:
        view.say(f"watch it at {site.address}")
        yield site.window


def _ends(report: "FlightReport") -> ExitCode:
    if report.failure == "interrupted":
        return ExitCode.INTERRUPTED
    if report.failure == "broken":
        return ExitCode.BROKEN
    return ExitCode.SUCCEEDED if report.success else ExitCode.FAILED
