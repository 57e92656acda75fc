"""A recorded flight as one HTML file. That it looks good is for eyes; that it is whole and true is tested here."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from protocols.mission.document import Mission
from rsc_swarm.flight.events import end_of
from rsc_swarm.flight.in_process import fly
from rsc_swarm.flight.recorded import Recorded
from rsc_swarm.flight.report import report_of
from rsc_swarm.flight.run_dir import RunDir, RunDirError
from rsc_swarm.show.page.page import page
from rsc_swarm.show.page.story import story
from world.outlets.recorder import Recorder

OPEN = {"discs": []}
FAULTS = [
    {"at_s": 0.2, "kind": "restart", "agents": [2]},
    {"at_s": 0.4, "kind": "part", "groups": [[0, 1], [2, 3]]},
    {"at_s": 0.6, "kind": "kill", "agents": [1]},
]


def recorded(where: Path, mission: Mission, told: bool = True) -> Recorded:
    """A flight of ``mission``, as its run directory keeps it."""
    folder, recorder = RunDir(where), Recorder(mission)
    folder.begin(mission)
    flown = fly(mission, recorder=recorder)
    folder.save_path(recorder.trajectory, recorder.mission, end_of(flown, mission))
    if told:
        folder.finish(report_of(flown, mission, "simulate", "lockstep", "rsc-swarm simulate --again"), "")
    return Recorded.load(folder)


class Reader(HTMLParser):
    """Which tags, texts and addresses a page has; fails on what is not closed."""

    VOID = ("meta", "br", "link", "img", "input")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.texts: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.labels: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.tags.append(tag)
        self.ids += [given["id"] or ""] if "id" in given else []
        self.links += [value or "" for name, value in attrs if name in ("href", "src")]
        self.labels += [given["aria-label"] or ""] if "aria-label" in given else []
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data.strip())


def read(text: str) -> Reader:
    reader = Reader()
    reader.feed(text)
    reader.close()
    assert not reader.open
    return reader


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return recorded(tmp_path_factory.mktemp("flight"), Mission(agents=4, fly_s=1.0, faults=FAULTS))


def test_a_page_needs_nothing_else_and_tells_everything(flight: Recorded) -> None:
    text = page(flight)
    seen = read(text)
    assert "script" not in seen.tags
    assert "http" not in text.replace("http-equiv", "")
    assert set(seen.links) <= {f"#{name}" for name in seen.ids}, "marks lead to events of this page"
    for event in flight.events:
        assert event.text in seen.texts
    for number in range(4):
        assert str(number) in seen.texts
    assert flight.report is not None
    assert flight.report.again in seen.texts
    assert flight.report.digest in seen.texts
    assert seen.labels[1:] == ["Worst edge error, %", "Slot error, m", "Nearest distance, m", "Speed, m/s"]


def test_deaths_and_restarts_are_marked_with_the_number_of_the_drone(flight: Recorded) -> None:
    text = page(flight)
    assert re.search(r'class="number kill"[^>]*>1<', text)
    assert re.search(r'class="number restart"[^>]*>2<', text)


def test_what_a_mission_is_called_cannot_break_the_page(tmp_path: Path) -> None:
    name = "<script>alert(1)</script> & 'more'"
    text = page(recorded(tmp_path, Mission(name=name, agents=1, fly_s=0.1, obstacles=OPEN)))
    assert "script" not in read(text).tags
    assert any(name in part for part in read(text).texts)


def test_of_one_drone_in_an_empty_field_only_what_there_is_is_told(tmp_path: Path) -> None:
    alone = recorded(tmp_path, Mission(agents=1, fly_s=0.5, obstacles=OPEN))
    text = page(alone)
    seen = read(text)
    assert seen.labels == ["Map of the flight", "Slot error, m", "Speed, m/s"]
    assert "One drone takes off, to fly through an empty field" in " ".join(seen.texts)
    assert "Nothing out of the ordinary." in seen.texts
    assert not re.search(r"\b(nan|inf)\b", text)


def test_a_flight_that_nobody_came_to_report_is_told_as_far_as_it_is_known(tmp_path: Path) -> None:
    lone = recorded(tmp_path, Mission(agents=2, fly_s=0.2, obstacles=OPEN), told=False)
    assert (lone.report, lone.end.failure) == (None, "interrupted")
    assert "interrupted after 0.20 s" in read(page(lone)).texts


def test_what_belongs_together_is_told_together(tmp_path: Path) -> None:
    swaps = recorded(tmp_path, Mission(agents=9, fly_s=1.0, start={"scrambled": True}, obstacles=OPEN))
    made = [event for event in swaps.events if event.what == "swap"]
    paragraphs = [part for part in story(swaps.events) if part.what == "swap"]
    assert len(made) > 2
    assert len(paragraphs) == 1
    assert paragraphs[0].text.startswith(f"{len(made)} pairs swap their slots: ")
    assert sum(len(part.events) for part in story(swaps.events)) == len(swaps.events) - 2


def test_what_is_no_recorded_flight_is_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(RunDirError, match=rf"^{tmp_path}: no flight recorded here; "):
        Recorded.load(RunDir(tmp_path))
    folder = RunDir(tmp_path / "run")
    kept = recorded(folder.path, Mission(agents=2, fly_s=0.1, obstacles=OPEN))
    other = Mission(agents=3, fly_s=0.1, obstacles=OPEN)
    folder.begin(other, overwrite=True)
    kept.path.save(folder.trajectory)
    with pytest.raises(RunDirError, match=r"trajectory.npz: is not the flight of the mission beside it$"):
        Recorded.load(folder)


@pytest.mark.parametrize(
    "change",
    [{"tau_s": 1e308, "success": True, "failure": None}, {"mission": {"a": 1}}, {"missed_faults": [9]}],
)
def test_what_a_report_says_of_the_flight_is_held_against_the_folder(
    change: dict[str, Any], tmp_path: Path
) -> None:
    recorded(tmp_path, Mission(agents=2, fly_s=0.1, obstacles=OPEN))
    folder = RunDir(tmp_path)
    folder.report.write_text(json.dumps(json.loads(folder.report.read_text()) | change))
    kept = Recorded.load(folder)
    assert kept.final_row == len(kept.path.slots) - 1
    assert "</html>" in page(kept)
