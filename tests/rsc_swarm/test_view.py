"""What is seen of a flight while it lasts."""

import dataclasses
import io
import signal
import threading

import pytest
from rich.console import Console

from protocols.mission.document import Mission
from rsc_swarm.flight.in_process import fly
from rsc_swarm.show.field_map import FieldMap
from rsc_swarm.show.line import line
from rsc_swarm.show.picture import picture
from rsc_swarm.show.view import View
from world.core import WorldCore
from world.outlets.recorder import Recorder
from world.outlets.snapshot import AgentRow, Snapshot


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
        screen.print(picture("simulate plain", snapshot, screen.size, FieldMap()))
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


def drone(agent: int, x_m: float, y_m: float, state: str = "flying") -> AgentRow:
    return AgentRow(agent, state, agent, x_m, y_m, 3.0, 5.0, 0.0, 0, 0)


def moment(*drones: AgentRow, **fields: object) -> Snapshot:
    of_field = {
        "discs": ((20.0, 0.0, 2.0),),
        "goal_x_m": 35.0,
        "depth_m": 5.0,
        "obstacles": 1,
        "obstacles_passed": 0,
    }
    counts = {"frames": {}, "swaps": {}, "deadline_misses": 0, "real_time_factor": 1.0}
    return Snapshot(tick=0, time_s=0.0, agents=drones, **{**of_field, **counts, **fields})  # type: ignore[arg-type]


def on_map(field: FieldMap, seen: Snapshot, columns: int = 60, lines: int = 12) -> list[str]:
    drawn = field.draw(seen, columns, lines)
    assert drawn is not None
    return "".join(segment.text for segment in drawn.segments).splitlines()


def test_the_map_shows_who_is_where():
    left, right = drone(0, 0.0, 8.0), drone(1, 10.0, -8.0, "frozen")
    lines = on_map(FieldMap(), moment(left, right, drone(2, 5.0, 0.0, "lost")))
    assert len(lines) == 12
    assert len({len(line) for line in lines}) == 1
    places = {
        sign: (row, line.index(sign)) for row, line in enumerate(lines) for sign in "●◌×" if sign in line
    }
    assert places["●"][0] < places["×"][0] < places["◌"][0], "y is up"
    assert places["●"][1] < places["×"][1] < places["◌"][1], "x is to the right"
    goal = lines[0].index("┊")
    rock = [column for line in lines for column, sign in enumerate(line) if "\u2800" < sign <= "\u28ff"]
    assert places["◌"][1] < min(rock) <= max(rock) < goal


def test_the_map_keeps_its_scale_while_the_swarm_flies():
    field = FieldMap()
    first = on_map(field, moment(drone(0, 0.0, 0.0)))
    later = on_map(field, moment(drone(0, 30.0, 0.0)))
    assert [line.replace("●", " ") for line in first] == [line.replace("●", " ") for line in later]


def test_of_a_long_field_the_map_shows_what_is_around_the_swarm():
    field = FieldMap()
    for x_m in (0.0, 5000.0, 90_000.0):
        seen = moment(drone(0, x_m, 0.0), drone(1, x_m + 20, 0.0), goal_x_m=1e6)
        assert "".join(on_map(field, seen)).count("●") == 2


@pytest.mark.parametrize(("height", "there"), [(40, True), (24, True), (14, False)])
def test_there_is_a_map_where_there_is_room_for_it(of_25, height, there):
    assert any("map: " in line for line in drawn(of_25[-1], height)) is there


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


class Pressed(Recorder):
    """Somebody presses Ctrl-C when the first row is recorded: where all begin."""

    def record(self, core: WorldCore) -> None:
        signal.raise_signal(signal.SIGINT)


def test_who_is_asked_to_leave_before_the_first_tick_has_flown_nothing() -> None:
    seen: list[Snapshot] = []
    with pytest.raises(KeyboardInterrupt):
        fly(
            Mission(agents=3, policy="analytic"), on_snapshot=seen.append, recorder=Pressed(Mission(agents=3))
        )
    assert seen == []
