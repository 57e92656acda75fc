"""A report as text for people: the verdict, where and when, the figures, and how to fly it again."""

import io
import sys
from typing import TextIO

from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from rsc_swarm.flight.report import FlightReport
from rsc_swarm.flight.words import agents_text, lost_text
from world.outcome import STRICT_HOLD_S, STRICT_SLOT_M

_SHOWN_FAULTS = 4
_HOW = {"simulate": "in one process", "launch": "in real processes", "world": "with drones from elsewhere"}


def render(report: FlightReport) -> RenderableType:
    """The report, to be printed by a rich console; without a terminal it is plain text."""
    mission = report.mission
    if report.success:
        verdict = Text.assemble(("SUCCESS", "bold green"), f": {report.detail}.")
    elif report.failure == "interrupted":
        verdict = Text.assemble(("STOPPED", "bold yellow"), f": {report.detail}.")
    elif report.failure == "broken":
        verdict = Text.assemble(("BROKEN", "bold red"), f": {report.detail}.")
    else:
        verdict = Text.assemble((f"FAILED ({report.failure})", "bold red"), f": {report.detail}.")
    lines: list[RenderableType] = [verdict]
    if report.min_distance_m is not None and report.failure != "collision":
        limit = mission["limits"]["collision_m"]
        lines.append(
            Text(
                f"Closest: {report.closest}, {report.min_distance_m:.2f} m apart "
                f"(a collision is less than {limit:g} m)."
            )
        )
    again = Text.assemble("Fly it again:  ", (report.again, "bold"), no_wrap=True, overflow="ignore")
    return Group(*lines, Text(), _figures(report), Text(), again)


def _figures(report: FlightReport) -> Table:
    table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    for name, text in figures(report):
        table.add_row(name, text)
    return table


def figures(report: FlightReport) -> list[tuple[str, str]]:
    """Name and figure; what one drone alone cannot have (edges, swaps, somebody to hear) is not told of it."""
    mission, frames, alone = report.mission, report.frames, report.agents == 1
    seeds = f"map {report.map_seed}, seed {report.seed}"
    when = "at success" if report.tau_s is not None else "at the end"
    rejected = ", ".join(f"{number:,} {reason}" for reason, number in frames.rejected.items() if number)
    how = _HOW[report.mode]
    tolerance, edge = 100 * mission["edge_tolerance"], 100 * report.max_edge_error
    rows = {
        "mission": f"{mission['name']}: {agents_text(report.agents)}, policy {report.policy}, {seeds}",
        "worst edge error": "" if alone else f"{edge:.2f} % {when} (limit {tolerance:g} %)",
        f"{'' if alone else 'worst '}slot error": f"{report.max_slot_error_m:.2f} m {when}",
        "strict success": _strict(report),
        "did not happen": _missed(report),
        "lost": lost_text(report.lost_agents) if report.lost_agents else "",
        "swaps": "" if alone else _swaps(report),
        "slots claimed twice": f"{report.overlap_s:.2f} s in all" if report.overlap_s else "",
        "frames sent": f"{frames.sent:,} of {frames.median_bytes:.0f} bytes (median)",
        "frames heard": "" if alone else _heard(report),
        "frames rejected": rejected,
        "flown": f"{report.time_s:.2f} s {how} in {report.wall_s:.1f} s, {_times(report.real_time_factor)} real time",
        "late answers": f"{report.deadline_misses:,} of {report.ticks * report.agents:,}"
        if report.commands
        else "",
        "commands": _commands(report),
        "first tick": f"{report.first_tick_s:.2f} s after the command"
        if report.first_tick_s is not None
        else "",
        "memory per agent": f"{report.pss_mb_per_agent:.1f} MB"
        if report.pss_mb_per_agent is not None
        else "",
        "swap history": _history(report),
        "digest": report.digest,
    }
    return [(name, text) for name, text in rows.items() if text]


def _strict(report: FlightReport) -> str:
    """When the strict success was, or what the paper's lacks of it; nothing where there was neither."""
    if report.paper_tau_s is None:
        return ""
    if report.strict_tau_s is not None:
        return f"from {report.strict_tau_s:.2f} s on"
    lacks = {
        "slots too far away": report.max_slot_error_m >= STRICT_SLOT_M and report.success,
        "views of the slots differed": report.agreed_at_success is False,
        f"the formation did not stand for {STRICT_HOLD_S:g} s": report.stood_on is False,
    }
    named = [lack for lack, so in lacks.items() if so] or [f"not kept for {STRICT_HOLD_S:g} s"]
    return f"none after that at {report.paper_tau_s:.2f} s: {', '.join(named)}"


def _missed(report: FlightReport) -> str:
    """The faults that came too late, each by what it was to do."""
    faults = [report.mission["faults"][place] for place in report.missed_faults]
    texts = [f"{fault['kind']} at {fault['at_s']:g} s" for fault in faults[:_SHOWN_FAULTS]]
    more = len(faults) - len(texts)
    return (
        ", ".join(texts) + (f" and {more} more" if more > 0 else "") + " (the flight was over)"
        if faults
        else ""
    )


def _commands(report: FlightReport) -> str:
    ages = report.commands
    if ages is None:
        return ""
    text = f"99 % at most {ages.p99_s:.2f} s old, the oldest {max(ages.longest_s):.2f} s"
    braked = [f"agent {agent} for {seconds:.2f} s" for agent, seconds in enumerate(ages.braked_s) if seconds]
    if braked:
        text += f"; the failsafe braked {', '.join(braked[:3])}{', ...' if len(braked) > 3 else ''}"
    return text + (f" and landed {lost_text(ages.landed)}" if ages.landed else "")


def _times(factor: float) -> str:
    return f"{factor:.1f} x" if factor >= 0.1 else f"{factor:.1g} x"


def _history(report: FlightReport) -> str:
    swaps = report.swaps
    if not (swaps.undone or swaps.unsealed):
        return ""
    return f"{swaps.undone} swaps undone by a merge, {swaps.unsealed} without their seals refused"


def _swaps(report: FlightReport) -> str:
    swaps = report.swaps
    text = f"{swaps.proposed} proposed, {swaps.committed} made" if swaps.proposed else "none"
    fates = [
        f"{number} {fate}"
        for fate, number in (
            ("refused", swaps.refused),
            ("withdrawn", swaps.withdrawn),
            ("timed out", swaps.timed_out),
        )
        if number
    ]
    if fates:
        text += f" ({', '.join(fates)})"
    if swaps.vacated:
        text += f", {swaps.vacated} slot{'s' if swaps.vacated > 1 else ''} taken over after deaths"
    return text


def _heard(report: FlightReport) -> str:
    frames = report.frames
    lost = {name: number for name, number in frames.dropped.model_dump().items() if number}
    text = f"{frames.delivered:,}"
    if lost:
        share = sum(lost.values()) / max(1, sum(lost.values()) + frames.delivered)
        by = ", ".join(f"{name.replace('_', ' ')} {number:,}" for name, number in lost.items())
        text += f"; {100 * share:.1f} % lost ({by})"
    return text


def console(stream: TextIO | None = None) -> Console:
    """A console on stdout or ``stream``: colours on a terminal (unless NO_COLOR), plain lines elsewhere."""
    stream = stream or sys.stdout
    # Elsewhere than on a terminal nothing may be wrapped: programs and screen readers want whole lines.
    return Console(file=stream, highlight=False, width=None if stream.isatty() else 400)


def show(renderable: RenderableType, stream: TextIO | None = None) -> None:
    """Print on stdout or ``stream``, without trailing blanks where it is no terminal."""
    out = console(stream)
    if out.is_terminal:
        out.print(renderable)
    else:
        out.file.write(plain(renderable))


def plain(renderable: RenderableType) -> str:
    """What ``renderable`` looks like in a file."""
    text = io.StringIO()
    console(text).print(renderable)
    return "\n".join(line.rstrip() for line in text.getvalue().splitlines()) + "\n"
