"""What an agent with a valid login can hear and say: its own two keys, and nothing else, however it asks.

Over a Unix socket, where a password says who one is, and over TLS, where a certificate must say the same.
An intruder here is a bare Zenoh session with an agent's true login that does not keep to the rules. Every
"nothing is heard" is followed by something that is, on the same path: silence is never mistaken for slowness.
"""

import multiprocessing
import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import pytest
import zenoh

from agent.radio.link import AgentLink
from protocols.wire import keys
from protocols.wire.keys import LinkError
from protocols.wire.login import Login
from protocols.wire.transport import COMMON
from tests.world.links import CREDENTIALS, LOGINS, PATIENCE_S, SWARM, drain, intruder, speak
from world.server import link as link_module
from world.server import pipes
from world.server.credentials import Credentials
from world.server.link import WorldLink

OTHERS_VOICES = (
    keys.tx(SWARM, 0),
    keys.tx(SWARM, 2),
    keys.tx(SWARM, 9),
    f"{SWARM}/tx/*",
    f"{SWARM}/tx/**",
    "*/tx/*",
    "**",
)
OTHERS_EARS = (
    keys.rx(SWARM, 0),
    keys.tx(SWARM, 0),
    f"{SWARM}/rx/*",
    f"{SWARM}/*/0",
    f"{SWARM}/**",
    "**/0",
    "**",
)


@pytest.mark.parametrize("mode", ["client", "peer", "router"])
def test_nobody_speaks_in_anothers_name(world: WorldLink, endpoint: str, mode: str) -> None:
    with intruder(endpoint, LOGINS[1], mode) as session:
        speak(world, session, 1, b"honest")
        for key in OTHERS_VOICES:
            session.put(key, b"spoofed")
            session.declare_publisher(key).put(b"spoofed")
            session.delete(key)
        session.delete(keys.tx(SWARM, 1))
        speak(world, session, 1, b"honest again")


def test_nobody_speaks_to_an_agent_in_the_worlds_name(world: WorldLink, endpoint: str) -> None:
    with (
        AgentLink(endpoint, LOGINS[0]) as victim,
        intruder(endpoint, LOGINS[1]) as session,
    ):
        for key in (keys.rx(SWARM, 0), f"{SWARM}/rx/*", f"{SWARM}/**", "**"):
            session.put(key, b"forged")
        session.put(keys.tx(SWARM, 1), b"forging is done")
        assert world.receive(PATIENCE_S) == (1, b"forging is done")
        world.send(0, b"true")
        assert victim.receive(PATIENCE_S) == b"true"


@pytest.mark.parametrize("mode", ["client", "peer", "router"])
def test_nobody_hears_what_is_meant_for_another(world: WorldLink, endpoint: str, mode: str) -> None:
    assert_deaf(world, endpoint, mode)


@pytest.mark.parametrize("lock", ["listens", "hears"])
def test_each_of_two_locks_alone_keeps_an_agent_from_hearing_another(
    endpoint: str, monkeypatch: pytest.MonkeyPatch, lock: str
) -> None:
    """With the other one open: what an agent may subscribe to, and what the world's router may put to it."""
    locks = link_module._access_control

    def one_open(swarm: str, agents: int, certified: bool) -> dict[str, Any]:
        control = locks(swarm, agents, certified)
        for rule in control["rules"]:
            if rule["id"].startswith(("listens", "hears")) and not rule["id"].startswith(lock):
                rule["key_exprs"] = [f"{swarm}/**"]
        return control

    monkeypatch.setattr(link_module, "_access_control", one_open)
    with WorldLink(CREDENTIALS, [endpoint]) as world:
        assert_deaf(world, endpoint, "client")


def test_a_link_that_reads_nothing_is_cut_and_the_world_goes_on(
    world: WorldLink, endpoint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its pipe fills, and the world would wait for it for ever in the middle of a send."""
    cuts: list[None] = []
    monkeypatch.setattr(pipes, "LOOK_S", 0.05)
    monkeypatch.setattr(pipes, "cut_fullest_pipe", lambda cut=pipes.cut_fullest_pipe: cuts.append(cut()))
    with AgentLink(endpoint, LOGINS[0]) as honest, deaf(world, endpoint, 1):
        deadline = time.monotonic() + 60.0
        while not cuts:  # how much a pipe holds is the machine's affair
            assert time.monotonic() < deadline
            world.send(1, bytes(3000))
        world.send(1, b"to nobody")
        world.send(0, b"the world goes on")
        assert honest.receive(PATIENCE_S) == b"the world goes on"
    assert len(cuts) < 10  # ... each 0.4 s after the last: the send had ended with the first


def test_what_comes_in_fragments_is_no_longer_than_a_drone_may_say(world: WorldLink, endpoint: str) -> None:
    """Zenoh would join up to a gigabyte; the world's own drones send no fragments."""
    with intruder(endpoint, LOGINS[1]) as session:
        speak(world, session, 1, b"here")
        own = session.declare_publisher(keys.tx(SWARM, 1), congestion_control=zenoh.CongestionControl.BLOCK)
        own.put(bytes(20_000_000))
        own.put(b"short enough")
        assert world.receive(PATIENCE_S) == (1, b"short enough")
        assert world.turned_away(1) == 0  # it never got as far


@contextmanager
def deaf(world: WorldLink, endpoint: str, agent: int) -> Iterator[None]:
    """An agent that is heard and then reads nothing: it is stopped, and in a process of its own."""
    process = multiprocessing.get_context("spawn").Process(
        target=listen_and_speak, args=(endpoint, LOGINS[agent])
    )
    process.start()
    try:
        assert world.receive(60.0) == (agent, b"here")
        os.kill(process.pid or 0, signal.SIGSTOP)
        yield
    finally:
        process.kill()
        process.join()


def listen_and_speak(endpoint: str, login: Login) -> None:
    # Set up as an agent is: other pipes of Zenoh's are none that the world waits for.
    with intruder(endpoint, login, set_up=COMMON) as session:
        own = session.declare_subscriber(keys.rx(SWARM, login.agent))
        while own is not None:
            session.put(keys.tx(SWARM, login.agent), b"here")
            time.sleep(0.1)


def assert_deaf(world: WorldLink, endpoint: str, mode: str) -> None:
    """Agent 1, who does not keep to the rules, hears nothing that is meant for, or said by, agent 0."""
    with (
        AgentLink(endpoint, LOGINS[0]) as victim,
        intruder(endpoint, LOGINS[1], mode) as session,
    ):
        own = session.declare_subscriber(keys.rx(SWARM, 1))
        ears = [session.declare_subscriber(key) for key in OTHERS_EARS]
        speak(world, session, 1, b"listening")
        victim.send(b"secret up")
        assert world.receive(PATIENCE_S) == (0, b"secret up")
        world.send(0, b"secret down")
        assert victim.receive(PATIENCE_S) == b"secret down"
        world.send(1, b"for you")
        drain(own, until=b"for you")
        overheard = [words for ear in ears for _, words in drain(ear)]
        assert b"secret down" not in overheard
        assert b"secret up" not in overheard


def test_queries_and_liveliness_find_out_nothing(world: WorldLink, endpoint: str) -> None:
    with AgentLink(endpoint, LOGINS[0]), intruder(endpoint, LOGINS[1]) as session:
        for selector in (keys.rx(SWARM, 0), "**", "@/**"):
            replies = [reply.ok for reply in session.get(selector, timeout=0.2)]
            about_itself = f"@/{session.zid()}/"
            assert [r for r in replies if r is None or not str(r.key_expr).startswith(about_itself)] == []
        assert list(session.liveliness().get("**", timeout=0.2)) == []
        whether_it_is_there = session.declare_publisher(keys.rx(SWARM, 0))
        speak(world, session, 1, b"asking")
        assert not whether_it_is_there.matching_status.matching  # type: ignore[attr-defined]


def test_two_agents_find_no_side_door_to_each_other(world: WorldLink, endpoint: str) -> None:
    with (
        intruder(endpoint, LOGINS[0]) as one,
        intruder(endpoint, LOGINS[1]) as two,
    ):
        own = two.declare_subscriber(keys.rx(SWARM, 1))
        ears = [two.declare_subscriber(key) for key in ("side/door", "**", "@side/door")]
        tokens = two.liveliness().declare_subscriber("**", history=True)
        two_answers = two.declare_queryable("side/query", lambda query: query.reply("side/query", b"psst"))
        one_token = one.liveliness().declare_token("side/token")
        for key in ("side/door", "@side/door", keys.rx(SWARM, 1)):
            one.put(key, b"psst")
        assert list(one.get("side/query", timeout=0.2)) == []
        one.put(keys.tx(SWARM, 0), b"done")
        while (message := world.receive(PATIENCE_S)) != (0, b"done"):
            assert message is not None
        world.send(1, b"for you")
        drain(own, until=b"for you")
        assert [words for ear in ears for _, words in drain(ear) if words != b"for you"] == []
        assert tokens.try_recv() is None
        del two_answers, one_token


@pytest.mark.parametrize(
    "wrong",
    [
        pytest.param({"password": "guessed"}, id="wrong password"),
        pytest.param({"password": CREDENTIALS.passwords[1]}, id="another's password"),
        pytest.param({"agent": 7}, id="unknown agent"),
        pytest.param({"swarm": "other"}, id="another swarm"),
    ],
)
def test_a_wrong_login_does_not_get_in(world: WorldLink, endpoint: str, wrong: dict[str, Any]) -> None:
    with pytest.raises(LinkError, match="use the file that was made for this agent") as caught:
        AgentLink(endpoint, replace(LOGINS[0], **wrong), connect_timeout_s=0.3)
    assert "\n" not in str(caught.value)


def test_without_a_login_nobody_gets_in(world: WorldLink, endpoint: str) -> None:
    with pytest.raises(zenoh.ZError), intruder(endpoint, None, patience_s=0.5):
        pass


def test_every_launch_has_fresh_passwords() -> None:
    passwords = [word for _ in range(3) for word in Credentials.fresh(SWARM, 5).passwords]
    assert len(set(passwords)) == 15
    assert min(map(len, passwords)) >= 32
