"""What a drone should not say: rubbish, lies that could not be true, floods. It harms nobody else."""

import functools
import itertools
import time
from collections.abc import Callable
from typing import Any

import msgpack
import pytest

from protocols.mission.document import Mission
from protocols.wire import messages
from protocols.wire.messages import Farewell, Hello, Ready, Reply, Welcome
from protocols.wire.status import SWAP_COUNTS, AgentStatus
from tests.loopback import Loopback, fly
from tests.world.served import SILENT, assert_struck_off, mission, told
from world.outcome import Outcome, StruckOff
from world.server import peer, running_time, session
from world.server.session import WorldServer

HELLO, WELCOME = messages._KINDS.index(Hello), messages._KINDS.index(Welcome)


NAN, INF = float("nan"), float("inf")


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

    task = mission(fly_s=0.2)
    disturbed = fly(task, lambda agent, tick, reply: [rubbish(reply), reply] if agent == 5 else [reply])
    assert disturbed.outcome == undisturbed(task)


@functools.cache
def undisturbed(task: Mission) -> Outcome:
    return fly(task).outcome


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


NONE = (0,) * len(SWAP_COUNTS)


OWN = bytes(range(6))


IMPOSSIBLE = {
    "no permutation": (AgentStatus(2, 0, (0,) * 7, NONE, 9, bytes([0, 1, 2, 2, 4, 5])), "permutation"),
    "slots beyond all": (AgentStatus(2, 0, (0,) * 7, NONE, 9, b"\xff" * 6), "permutation"),
    "another slot than its own": (AgentStatus(3, 0, (0,) * 7, NONE, 9, OWN), "own slot"),
    "a slot it does not claim": (AgentStatus(3, 0, (0,) * 7, NONE, 9, bytes([0, 1, 3, 2, 4, 5])), "own slot"),
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


@pytest.mark.parametrize("account", sorted({*IMPOSSIBLE} - {"a slot it does not claim"}))
def test_a_last_account_that_cannot_be_true_is_not_in_the_report(account: str) -> None:
    status, _ = IMPOSSIBLE[account]

    def turn(agent: int, tick: int, reply: bytes) -> list[bytes]:
        if (agent, tick) == (2, 25):
            swarm.drones[2].farewell = lambda: Farewell(told(reply).process, status)  # type: ignore[method-assign]
        return [reply]

    swarm = Loopback(mission(), turn)
    flown = WorldServer(swarm.mission, swarm, "lockstep", swarm).run()
    assert flown.statuses[2] != status
    assert flown.outcome == undisturbed(mission())


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
