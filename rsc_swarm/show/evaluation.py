"""An evaluation for people: the row of a table, what its columns mean, and the failures as commands."""

from collections.abc import Callable

from rich.box import SIMPLE_HEAD
from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from rsc_swarm.study.evaluate import Evaluation, Failed, flown_on
from rsc_swarm.study.intervals import failure_bound

_SHOWN_FAILURES = 20


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
        "strict %": number(result.strict_rate, 1, 100),
        "C %": number(result.collision_rate, 1, 100),
        "D %": number(result.noncollision_rate, 1, 100),
        "tau s": number(result.tau_mean_s, 2),
        "formed s": number(result.formed_mean_s, 2),
        "slot m": number(result.slot_error_max_m, 2),
        "stood 2 s %": number(result.stood_on_rate, 1, 100),
        "agreed %": number(result.agreed_at_success_rate, 1, 100),
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


def print_notes(out: Console, result: Evaluation, seconds: float, again: Callable[[Failed], str]) -> None:
    """What was flown and what stands in the row; ``again`` is the command that flies a failure once more."""
    out.print(
        f"\n{flown_on(result.maps, result.starts).capitalize()}, "
        f"in {seconds:.0f} s. S success, C collision, D other failure; strict: success by the stricter rules of "
        "docs/task.md; tau: mean time to success; "
        "formed: when the formation first stood; "
        "slot: largest slot error at success; stood 2 s, agreed: of all flights, those that succeeded as in the paper and "
        "stood for 2 s more, and those in which all drones then had one view of the slots; nearest: smallest distance ever; "
        "swaps: made per flight.",
        soft_wrap=False,
    )
    if result.missed_faults:
        out.print(
            f"{result.missed_faults} of {result.runs} flights were over before all faults of the mission had happened.",
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
    maps = result.maps[1] - result.maps[0] + 1
    if not result.failures:
        out.print(
            f"No failure in {result.runs} runs on {maps} map{'s' if maps > 1 else ''}: "
            f"the failure rate is below {100 * failure_bound(maps):.2g} % (95 %)."
        )
        return
    out.print(f"\n{len(result.failures)} failed. Fly them again:")
    for failed in result.failures[:_SHOWN_FAILURES]:
        said = f"   # {failed.failure}: {failed.detail}"
        out.print(Text.assemble((again(failed), "bold"), said), soft_wrap=True)
    if len(result.failures) > _SHOWN_FAILURES:
        out.print(f"and {len(result.failures) - _SHOWN_FAILURES} more; --json has them all")
