"""The world as a server: whatever drones say or leave unsaid, it flies on, and nobody else is moved by it."""

import functools
import itertools
import time
from collections.abc import Callable
from typing import Any

import msgpack
import numpy as np
import pytest

from protocols.mission.document import Mission, parse_briefing, parse_mission
from protocols.wire import messages
from protocols.wire.messages import Hello, Ready, Refused, Reply, Tick, Wait, Welcome
from protocols.wire.status import SWAP_COUNTS, AgentStatus
from rsc_swarm.flight.report import describe
from rsc_swarm.flight.simulate import simulate
from tests.loopback import Hosted, Loopback, fly
from world import failsafe
from world.outcome import Flown, StruckOff
from world.server import patience, peer, running_time, session
from world.server.ports import STRUCK_OFF, Lost
from world.server.session import Clock, ServerError, WorldServer

HELLO, WELCOME = messages._KINDS.index(Hello), messages._KINDS.index(Welcome)
NAN, INF = float("nan"), float("inf")


def mission(fly_s: float = 0.6, **fields: Any) -> Mission:
    return parse_mission({"agents": 6, "fly_s": fly_s, "obstacles": {"count": [1, 1]}, **fields})


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """The world waits for a missing answer no longer than it must."""
    fly(mission(fly_s=0.02))  # loads the kernels, which takes longer
    monkeypatch.setattr(patience, "PATIENCE_S", 0.7)
    monkeypatch.setattr(failsafe, "SILENT_S", 0.7)
    monkeypatch.setattr(peer, "TAKEOVER_S", 0.1)


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


def told(reply: bytes) -> Reply:
    message = messages.unpack_from_drone(reply, 6)
    assert isinstance(message, Reply)
    return message


def tampered(reply: bytes = b"", **parts: Any) -> bytes:
    """An answer of the drone that lies, some parts of it replaced; to the tick of ``reply``, if that is given."""
    good = told(reply) if reply else Reply(105, 0, 0, 0.0, 0.0, 5, b"x", None)
    return messages.pack(good._replace(**parts))


def with_bytes(reply: bytes, place: int, data: bytes) -> bytes:
    return reply[:place] + data + reply[place + len(data) :]


ANSWERS: dict[str, Callable[[bytes], bytes]] = {
    "nan-command": lambda reply: tampered(reply, ax=NAN),
    "infinite-command": lambda reply: tampered(reply, ay=-INF),
    "command-beyond-all-numbers": lambda reply: tampered(reply, ax=1e308, ay=1e308),
    "slot-of-another-swarm": lambda reply: tampered(reply, slot=6),
    "slot-beyond-all": lambda reply: tampered(reply, slot=65_535),
    "future-tick": lambda reply: tampered(reply, tick=1_000_000),
    "endless-tick": lambda reply: tampered(reply, tick=2**32 - 1),
    "status-of-text": lambda reply: tampered(reply, status="fine"),
    "status-of-another-version": lambda reply: tampered(reply, status=[0, 0, [0], [0], 0, bytes(6)]),
    "another-process": lambda reply: tampered(reply, process=7),
    "another-proof": lambda reply: tampered(reply, proof=told(reply).proof ^ 1),
    "frame-longer-than-it-says": lambda reply: with_bytes(reply, 18, b"\x00\x00"),
    "account-that-is-not-there": lambda reply: with_bytes(reply, 20, b"\x09\x00"),
    "cut-off": lambda reply: reply[:39],
    "long": lambda reply: reply + b"\x00",
}
GARBAGE = {
    "hello-of-another-version": [HELLO, 99, 105],
    "hello-of-another-kind": [HELLO, "", ""],
    "empty-hello": [HELLO],
    "welcome": [WELCOME, 105, {}, b"", 0],
    "deep": functools.reduce(lambda inner, _: [inner], range(400), 0),
    "refused": [6, 105, ""],
    "unknown-kind": [77],
    "no-list": "hello",
    "map": {1: 2},
}


@pytest.mark.parametrize("kind", [*ANSWERS, *GARBAGE])
def test_rubbish_beside_its_answers_changes_nothing(kind: str) -> None:
    def rubbish(reply: bytes) -> bytes:
        packed: bytes = ANSWERS[kind](reply) if kind in ANSWERS else msgpack.packb(GARBAGE[kind])
        return packed

    undisturbed = fly(mission()).outcome
    assert (
        fly(mission(), lambda agent, tick, reply: [rubbish(reply), reply] if agent == 5 else [reply]).outcome
        == undisturbed
    )


def assert_struck_off(flown: Flown, agent: int, at_s: float, why: str) -> None:
    """This drone alone was lost, and everybody else flew to the end."""
    outcome = flown.outcome
    assert outcome.struck_off == (StruckOff(agent, at_s, why),)
    assert (outcome.lost_agents, outcome.ticks) == ((agent,), 60)
    assert (outcome.success, outcome.failure, outcome.rest_failure) == (False, "broken", "late")


SILENT = "it has not answered for 0.7 s"


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize("data", [b"", b"\xc1", b"\x97", bytes(3000), b"R", tampered(ax=NAN)])
def test_a_drone_that_answers_rubbish_is_as_lost_as_one_that_is_silent(data: bytes) -> None:
    for said in ([], [data]):
        flown = fly(mission(), lambda agent, tick, reply: said if agent == 5 and tick >= 30 else [reply])  # noqa: B023
        assert_struck_off(flown, 5, 0.3, SILENT)


@pytest.mark.usefixtures("impatient")
def test_a_drone_that_speaks_for_all_ticks_to_come_must_still_answer_each() -> None:
    def leap(agent: int, tick: int, reply: bytes) -> list[bytes]:
        if agent != 5 or tick < 30:
            return [reply]
        return [tampered(tick=tick + 1000)] if tick == 30 else []

    assert_struck_off(fly(mission(), leap), 5, 0.3, SILENT)


def test_a_second_answer_to_the_same_tick_is_not_heard() -> None:
    def twice(agent: int, tick: int, reply: bytes) -> list[bytes]:
        return [reply, messages.pack(told(reply)._replace(ax=9.0))] if agent == 0 else [reply]

    assert fly(mission(), twice).outcome == fly(mission()).outcome


def test_frames_that_are_no_frames_are_relayed_counted_and_dropped() -> None:
    def spoil(agent: int, tick: int, reply: bytes) -> list[bytes]:
        return [messages.pack(told(reply)._replace(frame=b"\xc1 no frame"))] if agent == 1 else [reply]

    flown = fly(mission(), spoil)
    assert flown.outcome.failure == "late"
    assert flown.outcome.lost_agents == ()
    assert sum(flown.statuses[agent].rejected[1] for agent in range(6) if agent != 1) > 30
    assert sum(sum(status.rejected) for status in flown.statuses.values()) == sum(
        status.rejected[1] for status in flown.statuses.values()
    )


@pytest.mark.usefixtures("impatient")
def test_a_drone_that_never_answers_breaks_the_run_by_name() -> None:
    swarm = Loopback(mission(), lambda agent, tick, reply: [] if agent == 2 else [reply])
    flown = WorldServer(mission(), swarm, "lockstep", swarm).run()
    assert_struck_off(flown, 2, 0.0, SILENT)
    assert swarm.waits > 0, "the others are told meanwhile that the world lives"
    assert swarm.applied == [(STRUCK_OFF, (2,))], "its process, if it has one, is ended"


def test_no_fault_of_the_mission_brings_back_who_was_struck_off() -> None:
    task = mission(faults=[{"at_s": 0.2, "kind": "restart", "agents": [3, 4]}])

    def end(agent: int, tick: int, reply: bytes) -> list[bytes]:
        if (agent, tick) == (3, 10):
            swarm.gone.append(Lost(3, "shot"))
            return []
        return [reply]

    swarm = Loopback(task, end)
    assert_struck_off(WorldServer(task, swarm, "lockstep", swarm).run(), 3, 0.1, "shot")
    assert ("restart", (4,)) in swarm.applied


def test_when_nobody_is_left_the_flight_is_over_and_broken() -> None:
    def end(agent: int, tick: int, reply: bytes) -> list[bytes]:
        if tick == 10:
            swarm.gone.append(Lost(agent, "shot"))
            return []
        return [reply]

    swarm = Loopback(mission(), end)
    outcome = WorldServer(mission(), swarm, "lockstep", swarm).run().outcome
    assert (outcome.failure, outcome.rest_failure, len(outcome.struck_off)) == ("broken", "all-lost", 6)


def test_drones_whose_processes_end_break_the_run_by_name_and_cause() -> None:
    def end(agent: int, tick: int, reply: bytes) -> list[bytes]:
        if agent == 3 and tick == 10:
            swarm.gone += [Lost(3, "its process ended"), Lost(5, "shot")]
            return []
        return [reply]

    swarm = Loopback(mission(), end)
    flown = WorldServer(mission(), swarm, "lockstep", swarm).run()
    assert flown.outcome.struck_off == (StruckOff(3, 0.1, "its process ended"), StruckOff(5, 0.1, "shot"))
    assert describe(flown.outcome, mission()).startswith(
        "agent 3 was lost at t = 0.10 s without the mission's doing: its process ended; "
        "agent 5 was lost at t = 0.10 s without the mission's doing: shot. Those who were left: not in formation"
    )


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize("clock", ["lockstep", "realtime"])
def test_a_drone_whose_process_is_stopped_is_waited_for(clock: Clock) -> None:
    task = mission(fly_s=1.5)
    held: list[bytes] = []

    def stop(agent: int, tick: int, reply: bytes) -> list[bytes]:
        if agent == 2 and tick == 10:
            swarm.stopped.add(2)
        if 2 in swarm.stopped:
            held.append(reply)
            return []
        return [reply]

    def go_on() -> bool:
        if 2 in swarm.stopped and time.monotonic() > started + 2.0:
            swarm.stopped.clear()
            for reply in held:
                swarm.say(2, reply)
        return False

    swarm = Loopback(task, lambda agent, tick, reply: stop(agent, tick, reply) if agent == 2 else [reply])
    swarm.leaving = go_on  # type: ignore[method-assign]
    started = time.monotonic()
    flown = WorldServer(task, swarm, clock, swarm).run()
    assert flown.outcome.lost_agents == ()
    assert swarm.told[2] < 200
    if clock == "lockstep":
        assert flown.wall_s > 1.5
        assert flown.outcome == simulate([task])[0]


def test_a_pause_of_the_world_is_nobodys_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped for an hour between two looks, it waits as if nothing had happened."""
    task, clock = mission(), [0.0]

    def lag(agent: int, tick: int, reply: bytes) -> list[bytes]:
        if agent == 4 and tick in (5, 25):
            clock[0] += 3600.0
        return [reply]

    monkeypatch.setattr(
        session, "RunningTime", lambda: running_time.RunningTime(lambda: clock[0] + time.perf_counter())
    )
    assert fly(task, lag).outcome == simulate([task])[0]


def test_running_time_stands_still_while_its_process_does() -> None:
    times = iter([0.0, 0.2, 0.4, 60.4, 60.5])
    running = running_time.RunningTime(lambda: next(times))
    assert [round(running.now(), 6) for _ in range(4)] == [0.2, 0.4, 0.9, 1.0]


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


@pytest.mark.usefixtures("impatient")
def test_a_drone_that_answers_blindly_does_not_answer() -> None:
    blind = fly(
        mission(),
        lambda agent, tick, reply: [messages.pack(told(reply)._replace(proof=5))] if agent == 3 else [reply],
    )
    assert [struck.agent for struck in blind.outcome.struck_off] == [3]


@pytest.fixture
def an_even_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """A millisecond passes between two looks at the clock, however busy the machine is that tests."""
    looks = itertools.count()
    monkeypatch.setattr(session, "RunningTime", lambda: running_time.RunningTime(lambda: 1e-3 * next(looks)))


FLOODS = {
    "hello": lambda reply: messages.pack(Hello(messages.VERSION, 103)),
    "hello of others": lambda reply: messages.pack(Hello(messages.VERSION, 9)),
    "ready": lambda reply: messages.pack(Ready(103)),
    "its answer, again and again": lambda reply: reply,
    "rubbish": lambda reply: b"\xc1",
    "another version": lambda reply: messages.pack(Hello(99, 103)),
}


@pytest.mark.usefixtures("an_even_clock")
@pytest.mark.parametrize("say", FLOODS.values(), ids=FLOODS.keys())
def test_whoever_floods_the_world_is_struck_off_and_the_others_are_told_all_the_time_that_it_lives(
    say: Callable[[bytes], bytes],
) -> None:
    swarm = Loopback(
        mission(), lambda agent, tick, reply: [say(reply)] * 50 + [reply] if agent == 3 else [reply]
    )
    outcome = WorldServer(swarm.mission, swarm, "lockstep", swarm).run().outcome
    assert outcome.struck_off == (StruckOff(3, outcome.struck_off[0].at_s, peer.FLOODS),)
    assert (outcome.lost_agents, outcome.ticks) == ((3,), 60)
    assert swarm.told[3] < 2500


@pytest.mark.usefixtures("an_even_clock")
def test_whoever_is_turned_away_too_often_is_struck_off() -> None:
    def push(agent: int, tick: int, reply: bytes) -> list[bytes]:
        swarm.refused[3] = 100 * tick
        return [reply]

    task = mission(fly_s=3.0)
    swarm = Loopback(task, push)
    outcome = WorldServer(task, swarm, "lockstep", swarm).run().outcome
    assert [struck[::2] for struck in outcome.struck_off] == [(3, peer.FLOODS)]


def test_what_gathered_while_the_world_stood_still_is_no_flood() -> None:
    one = peer.Peer()
    one.turned_away(100_000, 1.0)
    assert not one.floods


@pytest.mark.parametrize("flood", [b"\xc1", messages.pack(Hello(messages.VERSION, 102))])
def test_being_alive_is_told_by_the_clock_and_not_by_idleness(flood: bytes) -> None:
    """Drone 3 does not answer for a second, in which drone 2 leaves no moment without a word."""

    def busy(agent: int, tick: int, reply: bytes) -> list[bytes]:
        if (agent, tick) != (3, 10):
            return [reply]
        begun.append((time.monotonic(), reply))
        return []

    def chatter() -> bool:
        if begun:
            if time.monotonic() < begun[0][0] + 1.0:
                swarm.say(2, flood)
            else:
                swarm.say(3, begun.pop()[1])
        return False

    begun: list[tuple[float, bytes]] = []
    swarm = Loopback(mission(), busy)
    swarm.leaving = chatter  # type: ignore[method-assign]
    WorldServer(swarm.mission, swarm, "lockstep", swarm).run()
    assert swarm.waits >= 4 * 4


def test_a_second_process_with_the_login_of_a_drone_is_refused_and_nothing_else_changes(
    capsys: pytest.CaptureFixture[str],
) -> None:
    task, refused = mission(), []

    def second(agent: int, tick: int, reply: bytes) -> list[bytes]:
        if agent != 3 or tick not in (0, 20, 40):
            return [reply]
        return [messages.pack(Hello(messages.VERSION, 9)), messages.pack(Ready(9)), reply]

    swarm = Loopback(task, second)
    say = swarm.send

    def listen(agent: int, payload: bytes) -> None:
        message = messages.unpack_from_world(payload)
        if isinstance(message, messages.Refused):
            refused.append((agent, message))
        say(agent, payload)

    swarm.send = listen  # type: ignore[method-assign]
    outcome = WorldServer(task, swarm, "lockstep", swarm).run().outcome
    assert outcome == simulate([task])[0]
    assert {(agent, message.process) for agent, message in refused} == {(3, 9)}
    assert refused[0][1].why.startswith("another process flies as agent 3 already")
    assert capsys.readouterr().err == "world: a second process with the login of agent 3 was refused\n"


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


NONE = (0,) * len(SWAP_COUNTS)
OWN = bytes(range(6))
IMPOSSIBLE = {
    "no permutation": (AgentStatus(2, 0, (0,) * 7, NONE, 9, bytes([0, 1, 2, 2, 4, 5])), "permutation"),
    "slots beyond all": (AgentStatus(2, 0, (0,) * 7, NONE, 9, b"\xff" * 6), "permutation"),
    "another slot than its own": (AgentStatus(3, 0, (0,) * 7, NONE, 9, OWN), "slots"),
    "a slot it does not claim": (AgentStatus(3, 0, (0,) * 7, NONE, 9, bytes([0, 1, 3, 2, 4, 5])), "slots"),
    "a million swaps": (AgentStatus(2, 0, (0,) * 7, (0, 10**6, *NONE[2:]), 9, OWN), "counts"),
    "swaps without a pause": (AgentStatus(2, 0, (0,) * 7, (0, 20, *NONE[2:]), 9, OWN), "pauses"),
    "frames beyond all": (AgentStatus(2, 0, (2**63, *(0,) * 6), NONE, 9, OWN), "counts"),
    "more neighbours than drones": (AgentStatus(2, 6, (0,) * 7, NONE, 9, OWN), "counts"),
}


@pytest.mark.parametrize(("status", "rule"), IMPOSSIBLE.values(), ids=IMPOSSIBLE.keys())
def test_a_drone_that_believes_the_impossible_is_struck_off_by_name(status: AgentStatus, rule: str) -> None:
    def believe(agent: int, tick: int, reply: bytes) -> list[bytes]:
        return [messages.pack(told(reply)._replace(status=status))] if (agent, tick) == (2, 25) else [reply]

    flown = fly(mission(), believe)
    (struck,) = flown.outcome.struck_off
    assert (struck.agent, struck.at_s) == (2, 0.25)
    assert struck.why.startswith("its account of itself cannot be true: it ")
    assert (flown.outcome.failure, flown.outcome.lost_agents, flown.outcome.ticks) == ("broken", (2,), 60)
    assert str(flown.watched.breach).startswith(f"{rule} broken at tick 25: agent 2 ")
    assert flown.statuses[2].view == OWN, "what it told before stands"


def test_a_drone_in_the_right_is_not_struck_off_for_another_that_borrows_its_digest() -> None:
    """Drone 2 says that it knows what all others know, and believes something else."""

    def lie(agent: int, tick: int, reply: bytes) -> list[bytes]:
        said = told(reply)
        if agent != 2 or said.status is None:
            return [reply]
        view = bytes([1, 0, 2, 3, 4, 5])
        return [messages.pack(said._replace(status=said.status._replace(view=view)))]

    flown = fly(mission(), lie)
    assert [struck.agent for struck in flown.outcome.struck_off] == [2]
    assert flown.outcome.lost_agents == (2,)


def test_the_launcher_is_asked_to_do_what_the_mission_says() -> None:
    faults = [
        {"at_s": 0.1 * index, "kind": kind, "agents": [1]}
        for index, kind in enumerate(["freeze", "thaw", "kill"], 1)
    ]
    swarm = Loopback(mission(faults=faults))
    outcome = WorldServer(swarm.mission, swarm, "lockstep", swarm).run().outcome
    assert swarm.applied == [("freeze", (1,)), ("thaw", (1,)), ("kill", (1,))]
    assert outcome.lost_agents == (1,)


@pytest.mark.usefixtures("impatient")
def test_a_restarted_drone_that_does_not_come_back_breaks_the_run() -> None:
    swarm = Loopback(mission(faults=[{"at_s": 0.1, "kind": "restart", "agents": [1]}]))
    swarm.apply = lambda kind, agents: swarm._alive.discard(1)  # type: ignore[method-assign]
    assert_struck_off(WorldServer(swarm.mission, swarm, "lockstep", swarm).run(), 1, 0.1, SILENT)


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


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize("clock", ["lockstep", "realtime"])
def test_a_drone_whose_process_comes_back_unannounced_knows_nothing_and_flies_on(clock: Clock) -> None:
    task = mission()
    swarm = Loopback(task)
    minds: list[Hosted] = []
    died: list[int] = []

    def die_once(agent: int, tick: int, reply: bytes) -> list[bytes]:
        if (agent, tick) == (3, 20) and not died:
            died.append(tick)
            swarm.process[3] = 7
        return [] if agent == 3 and died and minds[0] is swarm.drones[3] else [reply]

    def look() -> bool:
        if died and minds[0] is swarm.drones[3]:
            time.sleep(0.005)
            swarm.knock(3)
        return False

    swarm.leaving = look  # type: ignore[method-assign]
    swarm._meddle = die_once
    world = WorldServer(task, swarm, clock, swarm, lambda core: minds.append(swarm.drones[3]))
    outcome = world.run().outcome
    assert outcome.lost_agents == ()
    assert minds[0] is not minds[-1]
    assert [peer.boot for peer in world.peers] == [0, 0, 0, 1, 0, 0]
    assert swarm.drones[3].drone.tick == 59


def test_what_is_lost_between_the_world_and_a_drone_is_asked_and_answered_again() -> None:
    """A link that breaks and is made anew loses what was under way: here a Tick, there the answer to one."""
    task, lost = mission(), []

    def lose(agent: int, tick: int, reply: bytes) -> list[bytes]:
        if (agent, tick) == (4, 30) and "answer" not in lost:
            lost.append("answer")
            return []
        return [reply]

    swarm = Loopback(task, lose)
    send = swarm.send

    def drop(agent: int, payload: bytes) -> None:
        message = messages.unpack_from_world(payload)
        if isinstance(message, Tick) and (agent, message.tick) == (2, 20) and "question" not in lost:
            lost.append("question")
        elif isinstance(message, Wait):
            swarm.say(agent, messages.pack(Ready(swarm.process[agent])))
        else:
            send(agent, payload)

    swarm.send = drop  # type: ignore[method-assign]
    assert WorldServer(task, swarm, "lockstep", swarm).run().outcome == simulate([task])[0]
    assert lost == ["question", "answer"]


def test_who_only_says_that_it_is_there_is_asked_again_now_and_then() -> None:
    """Else the pipe of a drone that does not read would fill, and the world would wait for it."""
    one = peer.Peer()
    one.process = 7
    one.ask(3, 0, bytes(10_000), 100.0)
    again = [at for at in range(1000) if one.ask_again(100.0 + 0.1 * at)]
    assert again[0] == 9
    assert len(again) == 8
    one.answered = 3
    assert not one.ask_again(1000.0)


def test_a_process_that_this_world_never_welcomed_is_told_so() -> None:
    """The world has been started anew: a drone of the flight before is not left to wait."""
    swarm, told = Loopback(mission()), []
    send = swarm.send

    def listen(agent: int, payload: bytes) -> None:
        told.append((agent, messages.unpack_from_world(payload)))
        send(agent, payload)

    swarm.send = listen  # type: ignore[method-assign]
    swarm.say(4, messages.pack(Ready(77)))
    swarm._said.rotate(1)
    assert WorldServer(mission(), swarm, "lockstep", swarm).run().outcome == simulate([mission()])[0]
    assert told[0] == (4, Refused(77, "the world does not know this process: it has been started anew"))
