"""``rsc-swarm evaluate``: progress while it flies, the table row, and the failures as commands."""

import sys
import time
from contextlib import closing
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from protocols.mission.document import MissionError
from rsc_swarm.cli.fly import check_json
from rsc_swarm.cli.options import MissionOptions, command_line, resolve
from rsc_swarm.flight.run_dir import write_whole
from rsc_swarm.show.progress import TICKS_GUESS, Flights, Gauge
from rsc_swarm.show.render import console
from rsc_swarm.study.evaluate import (
    Evaluation,
    crew_size,
    evaluate,
    failure_bound,
    flown_on,
    journal_path,
    seeds_of,
    summarise,
)
from rsc_swarm.study.finished import fingerprint

_SHOWN_FAILURES = 20


def run(
    options: MissionOptions, maps: int, starts: int, seed_base: int, workers: int | None, json: str | None
) -> int:
    """Fly, print and write; the exit code.

    Raises:
        MissionError, rsc_swarm.study.workers.WorkerError, rsc_swarm.study.finished.FinishedFlightsError: as evaluate.
    """
    if options.map is not None or options.seed is not None:
        raise MissionError(
            "--map and --seed: evaluate chooses the seeds; use --seed-base, --maps and --starts"
        )
    crew = crew_size(workers)
    mission = resolve(options)
    seeds = seeds_of(seed_base, maps, starts)
    check_json(json)
    code = fingerprint(mission)
    journal = journal_path(Path(json), code) if json and json != "-" else None
    begin = time.monotonic()
    gauge = Gauge()
    progress = Flights(TICKS_GUESS * mission.ticks, gauge)
    try:
        with closing(gauge):
            gauge.begin(f"{len(seeds)} flights")
            flights = evaluate(mission, seeds, crew, journal, progress)
    except KeyboardInterrupt:
        failed = sum(not flight.outcome.success for flight in progress.flights)
        kept = (
            "; they are kept, and the same command goes on from there" if journal and progress.flights else ""
        )
        print(
            f"stopped after {len(progress.flights)} of {len(seeds)} flights, {failed} failed{kept}",
            file=sys.stderr,
        )
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
        "formed s": number(result.formed_mean_s, 2),
        "slot m": number(result.slot_error_max_m, 2),
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
    title = f"{row.pop('mission')}, {row.pop('N')} agents, policy {row.pop('policy')}"
    table = Table(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, pad_edge=False)
    for name in row:
        table.add_column(name, justify="right")
    table.add_row(*row.values())
    return table


def _print_notes(out: Console, result: Evaluation, options: MissionOptions, seconds: float) -> None:
    out.print(
        f"\n{flown_on(result.maps, result.starts).capitalize()}, "
        f"in {seconds:.0f} s. S success, C collision, D other failure; tau: mean time to success; "
        "formed: when the formation first stood; "
        "slot: largest slot error at success; nearest: smallest distance ever; swaps: made per flight.",
        soft_wrap=False,
    )
    if result.mission["faults"] and result.agreed_after_max_s is not None:
        out.print(
            f"Views of the slots equal within 1 s of the last fault in {100 * result.agreed_in_1s_rate:.1f} % of flights, "
            f"at most {result.agreed_after_max_s:.2f} s after it."
        )
    if result.mission["faults"] and result.allowed_after_max_s is not None:
        out.print(
            f"The radio allowed {100 * result.allowed_in_1s_rate:.1f} % and {result.allowed_after_max_s:.2f} s: the same, had "
            "every frame that arrived told all its sender knew."
        )
    if result.breaches or result.disagreed:
        out.print(
            f"[bold red]Slot views: {result.breaches} flights broke an invariant, {result.disagreed} ended in disagreement.[/]"
        )
    if not result.failures:
        out.print(
            f"No failure in {result.runs} runs: "
            f"the failure rate is below {100 * failure_bound(result.runs):.2g} % (95 %)."
        )
        return
    out.print(f"\n{len(result.failures)} failed. Fly them again:")
    for failed in result.failures[:_SHOWN_FAILURES]:
        command = command_line("simulate", options, map=failed.map, seed=failed.seed)
        out.print(Text.assemble((command, "bold"), f"   # {failed.failure}: {failed.detail}"), soft_wrap=True)
    if len(result.failures) > _SHOWN_FAILURES:
        out.print(f"and {len(result.failures) - _SHOWN_FAILURES} more; --json has them all")
