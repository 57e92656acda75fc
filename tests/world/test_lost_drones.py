"""Drones that do not answer: who is waited for, who is lost, and who comes back."""

import time

import pytest

from protocols.wire import messages
from protocols.wire.messages import Hello, Ready, Refused, Tick, Wait
from rsc_swarm.flight.report import describe
from rsc_swarm.flight.simulate import simulate
from tests.loopback import Hosted, Loopback, fly
from tests.world.served import SILENT, assert_struck_off, mission, told
from world.outcome import StruckOff
from world.server import peer, running_time, session
from world.server.ports import STRUCK_OFF, Lost
from world.server.session import Clock, WorldServer


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


@pytest.mark.usefixtures("impatient")
def test_a_drone_that_answers_blindly_does_not_answer() -> None:
    blind = fly(
        mission(),
        lambda agent, tick, reply: [messages.pack(told(reply)._replace(proof=5))] if agent == 3 else [reply],
    )
    assert [struck.agent for struck in blind.outcome.struck_off] == [3]


@pytest.mark.usefixtures("impatient")
def test_a_restarted_drone_that_does_not_come_back_breaks_the_run() -> None:
    swarm = Loopback(mission(faults=[{"at_s": 0.1, "kind": "restart", "agents": [1]}]))
    swarm.apply = lambda kind, agents: swarm._alive.discard(1)  # type: ignore[method-assign]
    assert_struck_off(WorldServer(swarm.mission, swarm, "lockstep", swarm).run(), 1, 0.1, SILENT)


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
