"""``rsc-swarm evaluate``: progress while it flies, the table row, and the failures as commands to fly again."""

import os
import sys
import time
from contextlib import closing
from pathlib import Path

from rich.console import Console, RenderableType
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from protocols.mission import Mission, MissionError
from rsc_swarm.crew import Flight
from rsc_swarm.evaluate import Evaluation, evaluate, journal_path, seeds_of, summarise
from rsc_swarm.journal import fingerprint
from rsc_swarm.options import MissionOptions, command_line
from rsc_swarm.render import console
from rsc_swarm.rundir import write_whole

_SHOWN_FAILURES = 20
_LINE_EVERY_S = 10.0


def run(
    mission: Mission, options: MissionOptions, maps: int, starts: int, seed_base: int, workers: int | None, json: str | None
) -> int:
    """Fly, print and write; the exit code.

    Raises:
        MissionError, rsc_swarm.crew.CrewError, rsc_swarm.journal.JournalError: as evaluate.
    """
    if options.map is not None or options.seed is not None:
        raise MissionError("--map and --seed: evaluate chooses the seeds; use --seed-base, --maps and --starts")
    if workers is not None and workers < 1:
        raise MissionError(f"--workers: give at least 1, not {workers}")
    seeds = seeds_of(seed_base, maps, starts)
    code = fingerprint(mission)
    journal = _journal(json, code)
    crew = workers or len(os.sched_getaffinity(0))
    flights: list[Flight] = []
    begin = time.monotonic()
    try:
        with closing(_Progress(len(seeds))) as progress:

            def on_flight(flight: Flight, known: bool) -> None:
                flights.append(flight)
                progress.count(flight, known)

            flights = evaluate(mission, seeds, crew, journal, on_flight)
    except KeyboardInterrupt:
        failed = sum(not flight.outcome.success for flight in flights)
        kept = "; they are kept, and the same command goes on from here" if journal else ""
        print(f"stopped after {len(flights)} of {len(seeds)} flights, {failed} failed{kept}", file=sys.stderr)
        return 130
    result = summarise(mission, flights, starts, code)
    if json == "-":
        print(result.model_dump_json(indent=2))
    elif json:
        write_whole(Path(json), result.model_dump_json(indent=2) + "\n")
    out = console(sys.stderr if json == "-" else sys.stdout)
    out.print(render(result, rich=out.is_terminal))
    _print_notes(out, result, options, time.monotonic() - begin)
    return 0


def _journal(json: str | None, code: str) -> Path | None:
    if not json or json == "-":
        return None
    path = Path(json)
    if path.is_dir() or not path.absolute().parent.is_dir() or not os.access(path.absolute().parent, os.W_OK):
        raise MissionError(f"--json {json}: cannot be written; give a file in a directory that exists")
    return journal_path(path, code)


class _Progress:
    """A bar on a terminal, a line now and then elsewhere; drawn when a flight ends, without a thread."""

    def __init__(self, total: int) -> None:
        self._total, self._done, self._failed, self._known = total, 0, 0, 0
        self._begin = self._line = time.monotonic()
        screen = console(sys.stderr)
        columns = (
            TextColumn("flights"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.description}"),
            TextColumn("time left"), TimeRemainingColumn(elapsed_when_finished=True),
        )  # fmt: skip
        self._bar = Progress(*columns, console=screen, auto_refresh=False, transient=True) if screen.is_terminal else None
        if self._bar:
            self._bar.start()
            self._task = self._bar.add_task("none failed", total=total)
            self._bar.refresh()

    def count(self, flight: Flight, known: bool) -> None:
        """One more flight, ``known`` from an earlier evaluation."""
        self._done += 1
        self._known += known
        self._failed += not flight.outcome.success
        now = time.monotonic()
        if self._bar:
            said = f"{self._failed} failed" if self._failed else "none failed"
            self._bar.update(self._task, advance=1, description=said)
            self._bar.refresh()
        elif now - self._line >= _LINE_EVERY_S:
            self._line = now
            fresh = self._done - self._known
            left = (self._total - self._done) * (now - self._begin) / fresh if fresh else 0.0
            print(
                f"{self._done} of {self._total} flights, {self._failed} failed, about {left:.0f} s left",
                file=sys.stderr,
                flush=True,
            )

    def close(self) -> None:
        """Take the bar off the screen."""
        if self._bar:
            self._bar.stop()


def _row(result: Evaluation) -> dict[str, str]:
    """The columns of the table and this evaluation's figures."""
    mission = result.mission

    def number(value: float | None, digits: int, scale: float = 1.0) -> str:
        return "-" if value is None else f"{scale * value:.{digits}f}"

    low, high = result.success_interval
    row = {
        "mission": mission["name"],
        "N": str(mission["agents"]),
        "policy": mission["policy"],
        "runs": str(result.runs),
        "S %": number(result.success_rate, 1, 100),
        "95 %": f"{100 * low:.1f}-{100 * high:.1f}",
        "C %": number(result.collision_rate, 1, 100),
        "D %": number(result.noncollision_rate, 1, 100),
        "tau s": number(result.tau_mean_s, 2),
        "worst slot m": number(result.slot_error_max_m, 2),
        "nearest m": number(result.min_distance_m, 2),
        "swaps": number(result.swaps_per_flight["committed"] + result.swaps_per_flight["vacated"], 1),
    }
    if result.held_rate is not None:
        row["held %"] = number(result.held_rate, 1, 100)
    return row


def render(result: Evaluation, rich: bool = False) -> RenderableType:
    """The table row: drawn on a terminal, Markdown elsewhere."""
    row = _row(result)
    if not rich:
        texts = [list(row), ["---"] * len(row), list(row.values())]
        return Text("\n".join("| " + " | ".join(cells) + " |" for cells in texts))
    table = Table()
    for name in row:
        table.add_column(name, justify="left" if name in ("mission", "policy") else "right")
    table.add_row(*row.values())
    return table


def _print_notes(out: Console, result: Evaluation, options: MissionOptions, seconds: float) -> None:
    first, last = result.maps
    out.print(
        f"\nMaps {first} to {last}, {result.starts} start{'s' if result.starts > 1 else ''} each, in {seconds:.0f} s. "
        "S success, C collision, D other failure; tau: mean time to success; worst slot: largest slot error at success; "
        "nearest: smallest distance in any run; swaps: made per flight.",
        soft_wrap=False,
    )
    if not result.failures:
        out.print(f"No failure in {result.runs} runs: the failure rate is below {300 / result.runs:.2g} % (95 %).")
        return
    out.print(f"\n{len(result.failures)} failed. Fly them again:")
    for failed in result.failures[:_SHOWN_FAILURES]:
        command = command_line("simulate", options, map=failed.map, seed=failed.seed)
        out.print(Text.assemble((command, "bold"), f"   # {failed.failure}: {failed.detail}"), soft_wrap=True)
    if len(result.failures) > _SHOWN_FAILURES:
        out.print(f"and {len(result.failures) - _SHOWN_FAILURES} more; --json has them all")
