"""The events of a flight: what happened, to whom and why, told from what was recorded."""

import json
import re
from pathlib import Path

import numpy as np

import rsc_swarm as rs
from protocols.mission.document import Mission
from rsc_swarm.flight.detours import detours
from rsc_swarm.flight.events import KINDS, End, Event, events_of, json_lines
from rsc_swarm.flight.simulate import Simulation
from world.outlets.recorder import Recorder
from world.outlets.trajectory import Trajectory

OPEN = {"discs": []}


class Straight:
    """Flies to its slot whatever is in between."""

    def __init__(self, mission: Mission) -> None:
        pass

    def act(self, seen: rs.Seen) -> np.ndarray:
        return 1.5 * seen.slot_error + 2.5 * (seen.target_velocity - seen.velocity)


def standing(agents: int, rows: int) -> Trajectory:
    """Drones that stay in their slots, 5 m apart, each in the slot of its number."""
    mission = Mission(agents=agents, formation={"shape": "line"})
    positions = np.tile(mission.layout.offsets, (rows, 1, 1)).astype(np.float64)
    slots = np.tile(np.arange(agents, dtype=np.int16), (rows, 1))
    flying = np.ones((rows, agents), np.bool_)
    return Trajectory(positions, np.zeros_like(positions), slots, flying, np.zeros((0, 3)), 30.0, 0.01)


def told(path: Trajectory, what: tuple[str, ...], **mission: object) -> list[Event]:
    flown = Mission(agents=path.slots.shape[1], formation={"shape": "line"}, obstacles=OPEN, **mission)
    return [event for event in events_of(path, flown, End(None, "over")) if event.what in what]


def test_two_drones_that_take_each_others_slots_have_swapped_though_one_heard_of_it_later():
    path = standing(4, 60)
    path.positions[:, [1, 2]] = path.positions[:, [2, 1]]  # each is at the other's place
    path.slots[10:, 1], path.slots[13:, 2] = 2, 1
    (swap,) = told(path, ("swap", "move", "takeover"))
    assert (swap.tick, swap.time_s, swap.agents, swap.slots, swap.of) == (9, 0.09, (1, 2), (2, 1), None)
    assert swap.text == "agents 1 and 2 swap: 1 is in slot 2 now, 2 in slot 1"
    assert re.fullmatch(r"it brings them [\d.]+ m nearer to their slots in all", swap.why)


def test_ranks_that_close_behind_a_dead_drone_are_taken_over_one_from_the_other():
    path = standing(4, 60)
    path.flying[6:, 0] = False
    path.slots[20:, 1], path.slots[22:, 2] = 0, 1
    faults = [{"at_s": 0.05, "kind": "kill", "slots": [0]}]
    kill, first, second = told(path, ("kill", "lost", "swap", "move", "takeover"), faults=faults)
    assert (kill.tick, kill.agents, kill.why) == (5, (0,), "fault 0 of the mission")
    assert (first.what, first.agents, first.slots, first.of, first.why) == (
        "takeover", (1,), (0,), 0, "agent 0 was silent"
    )  # fmt: skip
    assert (second.what, second.agents, second.of, second.why) == ("takeover", (2,), 1, "agent 1 left it")


def test_a_drone_that_begins_anew_is_in_its_first_slot_until_it_has_heard():
    path = standing(4, 60)
    path.slots[:20, 3], path.slots[:, 2] = 2, 3
    path.slots[20:40, 3], path.slots[40:, 3] = 3, 2
    moves = told(path, ("move",), faults=[{"at_s": 0.19, "kind": "restart", "agents": [3]}])
    assert [(move.tick, move.slots, move.why) for move in moves] == [
        (19, (3,), "it began anew"),
        (39, (2,), "it heard of swaps of others"),
    ]


def test_who_was_struck_off_does_not_begin_anew():
    path = standing(3, 60)
    path.flying[6:, 0] = False
    faults = [
        {"at_s": 0.3, "kind": "slow", "agents": [0, 2]},
        {"at_s": 0.4, "kind": "restart", "agents": [0, 1]},
    ]
    befell = told(path, ("lost", "slow", "restart"), faults=faults)
    assert [(event.tick, event.what, event.agents) for event in befell] == [
        (5, "lost", (0,)), (30, "slow", (2,)), (40, "restart", (1,)),
    ]  # fmt: skip


def test_who_falls_without_the_missions_doing_is_lost_and_why_is_told():
    path = standing(3, 20)
    path.flying[8:, 2] = False
    end = End("broken", "over", {2: "it is struck off: it has not answered for 90 s"})
    mission = Mission(agents=3, formation={"shape": "line"}, obstacles=OPEN)
    (lost,) = [event for event in events_of(path, mission, end) if event.what == "lost"]
    assert (lost.tick, lost.agents, lost.text) == (7, (2,), "agent 2 is out of the air")
    assert lost.why == "it is struck off: it has not answered for 90 s"


FAULTS = [
    {"at_s": 0.1, "kind": "freeze", "agents": [1]},
    {"at_s": 0.2, "kind": "thaw", "agents": [1]},
    {"at_s": 0.3, "kind": "part", "groups": [[0, 1], [2]]},
    {"at_s": 0.4, "kind": "slow", "agents": [0], "factor": 0.5},
    {"at_s": 0.5, "kind": "heal"},
    {"at_s": 0.6, "kind": "recover", "agents": [0]},
    {"at_s": 0.7, "kind": "restart", "agents": [2]},
    {"at_s": 0.75, "kind": "lie", "agents": [2], "lie": "all-alive"},
    {"at_s": 0.8, "kind": "kill", "agents": [3]},
    {"at_s": 0.9, "kind": "truth", "agents": [2]},
    {"at_s": 5, "kind": "kill", "agents": [0]},
]


def test_every_fault_is_told_when_it_struck_and_none_that_came_too_late():
    flight = rs.simulate(rs.mission(agents=4, fly_s=1.0, faults=FAULTS))
    struck = [(event.time_s, event.what) for event in flight.events if event.why.startswith("fault ")]
    assert struck == [(fault["at_s"], fault["kind"]) for fault in FAULTS[:-1]]
    parted = next(event for event in flight.events if event.what == "part")
    assert parted.text == "the radio is parted: 0, 1 | 2 | 3 hear each other no more"
    lied = next(event for event in flight.events if event.what == "lie")
    assert lied.text == "agent 2 lies by radio: it has just heard everybody, the dead too"
    assert (flight.events[0].what, flight.events[-1].what) == ("start", "end")
    assert (flight.events[-1].why, flight.events[-1].text) == ("late", flight.report.detail)


def test_success_and_the_closest_moment_are_those_of_the_report():
    flight = rs.simulate(rs.mission(agents=3, obstacles=OPEN, hold_s=0.5))
    by_kind = {event.what: event for event in flight.events}
    report = flight.report
    assert report.success
    assert (by_kind["success"].time_s, by_kind["formed"].time_s) == (report.tau_s, report.formed_s)
    assert by_kind["end"].tick == report.ticks
    closest = by_kind["closest"]
    assert f": {report.min_distance_m:.2f} m," in closest.text
    assert report.closest.endswith(f"t = {closest.time_s:.2f} s")


def test_a_collision_names_who_and_what():
    flight = rs.simulate(
        rs.mission(
            agents=1, safety_filter=False, detour=False, policy=Straight, obstacles={"discs": [[15, 0, 1]]}
        )
    )
    assert flight.report.failure == "collision"
    collision, end = flight.events[-2:]
    assert (collision.what, collision.agents, collision.obstacle) == ("collision", (0,), 0)
    assert collision.tick == end.tick == flight.report.ticks
    assert collision.text.startswith("agent 0 and obstacle 0 collide: 0.4")


def test_one_drone_alone_has_no_formation_and_no_neighbour():
    flight = rs.simulate(rs.mission(agents=1, obstacles=OPEN))
    assert [event.what for event in flight.events] == ["start", "success", "end"]


def test_detours_are_those_that_the_drones_made():
    """... though told from outside, by one who sees only their paths."""
    mission = rs.mission("dense", map_seed=5, agents=9)
    simulation, recorder = Simulation([mission]), Recorder(mission)
    recorder.record(simulation.world)
    stalled = simulation.agents._memory.stalled
    begun: dict[int, int] = {}
    while simulation.world.active[0]:
        simulation.tick()
        recorder.record(simulation.world)
        for agent in np.flatnonzero(stalled > 31).tolist():
            begun.setdefault(agent, simulation.clock)
    seen: dict[int, int] = {}
    for detour in detours(recorder.trajectory, mission):
        seen.setdefault(detour.agent, detour.tick)
    assert begun
    assert seen.keys() == begun.keys()
    assert all(abs(seen[agent] - tick) <= 5 for agent, tick in begun.items())


def test_a_file_of_events_has_a_line_for_each_with_all_fields():
    flight = rs.simulate(rs.mission(agents=4, fly_s=1.0, faults=FAULTS))
    lines = [json.loads(line) for line in json_lines(flight.events).splitlines()]
    assert len(lines) == len(flight.events)
    assert {tuple(line) for line in lines} == {tuple(Event.__annotations__)}
    assert all(line["what"] in KINDS for line in lines)


def test_the_documentation_names_every_kind_and_every_field():
    text = (Path(__file__).parents[2] / "docs" / "recordings.md").read_text()
    for kind, meaning in KINDS.items():
        assert f"| `{kind}` | {meaning} |" in text
    for name in Event.__annotations__:
        assert f"`{name}`" in text
