"""The world as a server: how a flight begins and ends, what drones and the launcher are told of it, and how much at once."""

import numpy as np
import pytest

from protocols.mission.document import parse_briefing
from protocols.wire import messages
from protocols.wire.messages import Hello
from rsc_swarm.flight.simulate import simulate
from tests.loopback import Loopback, fly
from tests.world.served import mission
from world.server import peer
from world.server.ports import Lost, ServerError
from world.server.session import WorldServer


def test_drones_that_exchange_bytes_fly_the_flight_of_drones_that_share_rows() -> None:
    task = mission(fly_s=21.0)
    flown = fly(task)
    assert flown.outcome.success
    assert flown.outcome == simulate([task])[0]


def test_the_figures_of_a_flight_are_told() -> None:
    flown = fly(mission())
    assert flown.outcome.ticks == 60
    assert flown.tally["sent"] == 6 * 60
    assert 50 < flown.median_frame_bytes < 250
    assert sorted(flown.statuses) == list(range(6))
    assert flown.watched.breach is None
    assert flown.deadline_misses == 0


def test_a_drone_that_does_not_answer_is_not_flooded() -> None:
    """Else its pipe would fill, and the world would wait for it in the middle of a tick."""
    task = mission(fly_s=1.0)
    asked: list[int] = []

    def fall_silent(agent: int, tick: int, reply: bytes) -> list[bytes]:
        if agent == 2:
            asked.append(tick)
            return [] if tick >= 10 else [reply]
        return [reply]

    swarm = Loopback(task, fall_silent)
    WorldServer(task, swarm, "realtime", swarm).run()
    assert asked == list(range(10 + peer.BACKLOG + 1))
    assert swarm.told[2] < len(asked) + 10


@pytest.mark.parametrize("size", [10, 30_000])
def test_a_pipe_is_full_of_many_messages_or_of_long_ones(size: int) -> None:
    one = peer.Peer()
    one.process = 7
    tick = 0
    while not one.backlogged and one.room(size):
        one.ask(tick, 0, bytes(size), 0.2 * tick)
        tick += 1
    assert tick == (peer.BACKLOG + 1 if size == 10 else 3)
    assert [one.wait(100.0 + at) for at in range(7)] == [True] * 5 + [False] * 2
    one.heard()
    assert one.wait(200.0)


def test_who_answers_without_reading_is_sent_no_more_than_a_pipe_holds() -> None:
    """It guesses the number of every tick; only what was in the Tick proves that it was read."""
    one = peer.Peer()
    one.process, sent = 7, 0
    for tick in range(1000):
        if one.room(3000):
            one.ask(tick, 4711, bytes(3000), 0.01 * tick)
            sent += 3000
        assert not one.answer(tick, 0)
        one.arrive()
        one.excuse()
    assert sent < 140_000
    one.ask(2000, 4711, b"", 20.0)
    assert one.answer(2000, 4711)
    assert one.room(100_000)


def test_a_drone_of_another_version_is_refused_by_name_before_the_flight() -> None:
    swarm = Loopback(mission())
    swarm.say(4, messages.pack(Hello(messages.VERSION + 1, 4)))
    swarm._said.rotate(1)
    told = f"^agent 4 speaks version {messages.VERSION + 1} of the messages, the world {messages.VERSION}$"
    with pytest.raises(ServerError, match=told):
        WorldServer(mission(), swarm, "lockstep", swarm).run()


def test_drones_that_do_not_come_are_named() -> None:
    swarm = Loopback(mission())
    swarm._alive -= {1, 4}
    with pytest.raises(ServerError, match=r"^agents \[1, 4\] did not arrive within 2.5 s$"):
        WorldServer(mission(), swarm, "lockstep", swarm, join_s=2.5).run()


def test_how_many_drones_have_come_is_told_until_all_have() -> None:
    swarm = Loopback(mission(fly_s=0.1))
    WorldServer(mission(fly_s=0.1), swarm, "lockstep", swarm).run()
    assert swarm.ready == [0, 1, 2, 3, 4, 5]


def test_a_process_that_ends_before_the_flight_is_named() -> None:
    swarm = Loopback(mission())
    swarm._alive.discard(3)
    swarm.gone = [Lost(3, "shot")]
    with pytest.raises(ServerError, match=r"^agent 3 was lost before the flight began: shot$"):
        WorldServer(mission(), swarm, "lockstep", swarm).run()


def test_a_flight_can_be_broken_off_and_nobody_is_lost_by_that() -> None:
    swarm = Loopback(mission(fly_s=21.0), lambda agent, tick, reply: [] if tick >= 20 else [reply])
    swarm.leave_at = 20
    outcome = WorldServer(mission(fly_s=21.0), swarm, "lockstep", swarm).run().outcome
    assert (outcome.failure, outcome.ticks, outcome.lost_agents) == ("interrupted", 20, ())


def test_who_is_asked_to_leave_before_the_first_tick_has_flown_nothing_and_shows_nothing() -> None:
    swarm = Loopback(mission(), lambda agent, tick, reply: [])
    swarm.leave_at = 0
    with pytest.raises(ServerError, match=r"^asked to leave before the first tick$"):
        WorldServer(mission(), swarm, "lockstep", swarm).run()
    assert swarm.pictures == []


def test_the_launcher_is_asked_to_do_what_the_mission_says() -> None:
    faults = [
        {"at_s": 0.1 * index, "kind": kind, "agents": [1]}
        for index, kind in enumerate(["freeze", "thaw", "kill"], 1)
    ]
    swarm = Loopback(mission(faults=faults))
    outcome = WorldServer(swarm.mission, swarm, "lockstep", swarm).run().outcome
    assert swarm.applied == [("freeze", (1,)), ("thaw", (1,)), ("kill", (1,))]
    assert outcome.lost_agents == (1,)


def test_in_real_time_a_late_answer_is_counted_and_the_last_command_stands() -> None:
    seen: dict[int, np.ndarray] = {}
    task = mission(fly_s=0.3)
    swarm = Loopback(task, lambda agent, tick, reply: [] if agent == 2 and 10 <= tick < 20 else [reply])
    world = WorldServer(
        task,
        swarm,
        "realtime",
        swarm,
        lambda core: seen.setdefault(int(core.tick[0]), core.command[0, 2].copy()),
    )
    flown = world.run()
    assert flown.outcome.lost_agents == ()
    assert flown.deadline_misses >= 10
    assert all(seen[tick].tolist() == seen[10].tolist() for tick in range(11, 21))
    assert flown.wall_s > 0.28


def test_a_picture_tells_who_flies_and_who_is_frozen() -> None:
    swarm = Loopback(mission(faults=[{"at_s": 0.1, "kind": "freeze", "agents": [3]}]))
    WorldServer(swarm.mission, swarm, "lockstep", swarm).run()
    picture = swarm.pictures[-1]
    assert (picture.tick, picture.time_s) == (60, pytest.approx(0.6))
    assert [row.state for row in picture.agents] == ["flying"] * 3 + ["frozen"] + ["flying"] * 2
    assert [row.slot for row in picture.agents] == list(range(6))
    assert (picture.obstacles, picture.obstacles_passed) == (1, 0)


def test_drones_are_told_what_they_need_and_nothing_of_the_field_the_future_or_the_code_to_run() -> None:
    task = mission(
        swarm="blue", policy="cruise", map_seed=7, seed=9, obstacles={"discs": [[20, 0, 2]]},
        faults=[{"at_s": 0.1, "kind": "kill", "agents": [1]}],
    )  # fmt: skip
    swarm = Loopback(task)
    WorldServer(task, swarm, "lockstep", swarm).run()
    briefing, told = task.briefing(), swarm.drones[5].mission
    assert "policy" not in briefing
    assert (briefing["map_seed"], briefing["seed"], briefing["faults"]) == (0, 0, [])
    assert briefing["obstacles"]["discs"] == []
    assert (told.swarm, told.policy, told.limits, told.layout) == (
        task.swarm,
        "cruise",
        task.limits,
        task.layout,
    )
    assert told == task.told


def test_a_world_that_names_code_to_run_is_not_heard() -> None:
    told = parse_briefing({**mission().briefing(), "policy": "evil.py:Evil"}, "cruise")
    assert told.policy == "cruise"
