"""A flight as one HTML file that needs nothing else: what happened in plain words, the map, curves, all events, and how to fly it
again. To be opened anywhere, printed, or attached to an issue.
"""

from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from protocols.mission.document import mission_yaml
from protocols.whole_file import write_whole
from rsc_swarm.flight.events import KINDS
from rsc_swarm.flight.recorded import Recorded
from rsc_swarm.flight.words import agents_text
from rsc_swarm.show.page import curves
from rsc_swarm.show.page.drawing import drawing
from rsc_swarm.show.page.story import opening, story
from rsc_swarm.show.render import figures

_VERDICTS = {None: ("SUCCESS", "good"), "interrupted": ("STOPPED", "odd"), "broken": ("BROKEN", "bad")}


def write_page(recorded: Recorded, out: Path) -> None:
    """Write the page of a flight into the file ``out``.

    Raises:
        protocols.whole_file.WriteError: it cannot be written.
    """
    write_whole(out, page(recorded))


def page(recorded: Recorded) -> str:
    """The page of a flight, as HTML."""
    environment = Environment(
        loader=PackageLoader("rsc_swarm.show.page"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    return environment.get_template("report.html").render(**_told(recorded))


def _told(recorded: Recorded) -> dict[str, Any]:
    mission, report, failure = recorded.mission, recorded.report, recorded.end.failure
    verdict, mood = _VERDICTS.get(failure, (f"FAILED: {failure}", "bad"))
    shown = drawing(recorded)
    return {
        "mission": mission,
        "who": agents_text(mission.agents),
        "verdict": verdict,
        "mood": mood,
        "ending": recorded.end.text,
        "opening": opening(recorded),
        "story": story(recorded.events),
        "map": shown,
        "marked": [kind for kind in KINDS if any(mark.what == kind for mark in shown.marks)],
        "curves": curves.curves(recorded),
        "size": curves,
        "events": recorded.events,
        "kinds": KINDS,
        "figures": figures(report) if report else [],
        "report": report,
        "yaml": mission_yaml(mission),
    }
