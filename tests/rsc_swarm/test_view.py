"""What is seen of a flight while it lasts."""

import dataclasses
import io
import threading

import pytest
from rich.console import Console

from protocols.mission.document import Mission
from rsc_swarm.flight.in_process import fly
from rsc_swarm.show.view import View, line, picture
from world.outlets.snapshot import Snapshot


def snapshots(agents: int, **fields: object) -> list[Snapshot]:
    seen: list[Snapshot] = []
    fly(Mission(agents=agents, fly_s=5.0, **fields), on_snapshot=seen.append)
    return seen


@pytest.fixture(scope="module")
def of_25() -> list[Snapshot]:
    return snapshots(25)


def drawn(snapshot: Snapshot, height: int = 40) -> list[str]:
    screen = Console(file=io.StringIO(), width=80, height=height, force_terminal=True, color_system=None)
    with screen.capture() as capture:
        screen.print(picture("simulate plain", snapshot, height))
    return capture.get().splitlines()


def test_25_drones_fit_on_a_small_terminal(of_25):
    lines = drawn(of_25[-1])
    assert len(lines) <= 40
    assert max(len(text) for text in lines) <= 80
    numbers = {
        int(number) for text in lines[5:] for number in (text[:5], text[39:46]) if number.strip().isdigit()
    }
    assert numbers == set(range(25))


@pytest.mark.parametrize(("agents", "height"), [(1, 40), (20, 40), (100, 40), (100, 12)])
def test_any_swarm_fits_on_any_terminal(agents, height):
    row = snapshots(1)[0].agents[0]
    some = dataclasses.replace(
        snapshots(1)[0], agents=tuple(dataclasses.replace(row, agent=number) for number in range(agents))
    )
    lines = drawn(some, height)
    assert len(lines) < height
    shown = sum(text.count("m/s") for text in lines)
    assert shown == (1 if agents <= 20 else 2)
    assert any("more" in text for text in lines) == (agents == 100)


def test_lost_and_frozen_drones_stand_out():
    faults = [{"at_s": 1, "kind": "kill", "agents": [2]}, {"at_s": 1, "kind": "freeze", "agents": [3]}]
    last = snapshots(4, faults=faults)[-1]
    assert [row.state for row in last.agents] == ["flying", "flying", "lost", "frozen"]
    assert any(text.split() == ["2", "lost"] for text in drawn(last))
    assert line(last).endswith("lost 1")


def test_of_one_drone_in_an_empty_field_only_what_there_is_is_shown():
    alone = snapshots(1, obstacles={"discs": []})[-1]
    assert line(alone).split()[-3:] == ["x", "real", "time"]
    assert not any("obstacles" in text or "inf" in text for text in drawn(alone))


def test_without_a_terminal_there_is_one_line_every_two_seconds(of_25):
    stream = io.StringIO()
    with View("a flight", stream) as view:
        for snapshot in of_25:
            view.update(snapshot)
    lines = stream.getvalue().splitlines()
    assert len(lines) == 3
    assert lines[1].startswith("t   2.00 s")
    assert "\x1b" not in stream.getvalue()


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_before_the_first_tick_one_sees_how_many_drones_are_awaited(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    for stream, shown in ((Terminal(), True), (io.StringIO(), False)):
        with View("a flight", stream) as view:
            view.waiting(7, 25)
        assert ("waiting for drones: 7 of 25" in stream.getvalue()) is shown


def test_the_view_needs_no_thread(of_25):
    before = threading.active_count()
    with View("a flight", io.StringIO()) as view:
        view.update(of_25[0])
        assert threading.active_count() == before
