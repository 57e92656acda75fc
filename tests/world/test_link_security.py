"""What an agent with a valid login can hear and say: its own two keys, and nothing else, however it asks.

Over a Unix socket, where a password says who one is, and over TLS, where a certificate must say the same.
An intruder here is a bare Zenoh session with an agent's true login that does not keep to the rules. Every
"nothing is heard" is followed by something that is, on the same path: silence is never mistaken for slowness.
"""

import json
import multiprocessing
import os
import signal
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
import zenoh

from agent.radio.link import AgentLink
from protocols.wire import keys, messages
from protocols.wire.endpoints import is_secret
from protocols.wire.keys import LinkError
from protocols.wire.login import Login
from protocols.wire.transport import COMMON, secret
from world.server import link as link_module
from world.server import pipes
from world.server.credentials import Credentials, make_keys
from world.server.link import WorldLink

SWARM = "wedge"
PATIENCE_S = 20.0  # only what fails takes so long
CREDENTIALS, LOGINS = make_keys(SWARM, 3, ["127.0.0.1"], 1, datetime.now(UTC))
EVERYWHERE = pytest.mark.parametrize("endpoint", ["unixsock-stream", "tls", "quic"], indirect=True)
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


@pytest.fixture(params=["unixsock-stream", "tls"])
def endpoint(tmp_path: Path, request: pytest.FixtureRequest) -> str:
    if request.param == "unixsock-stream":
        return f"unixsock-stream/{tmp_path}/world.sock"
    with socket.create_server(("127.0.0.1", 0)) as free:
        return f"{request.param}/127.0.0.1:{free.getsockname()[1]}"


@pytest.fixture
def world(endpoint: str) -> Iterator[WorldLink]:
    with WorldLink(CREDENTIALS, [endpoint]) as link:
        yield link


@contextmanager
def intruder(
    endpoint: str, login: Login | None, mode: str = "client", set_up: dict[str, Any] | None = None
) -> Iterator[zenoh.Session]:
    settings: dict[str, Any] = {
        **(set_up or {}),
        "mode": mode,
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": 500,
        "connect/exit_on_failure": True,
        "listen/endpoints": [],
        "scouting/multicast/enabled": False,
        "scouting/delay": 0,
    }
    if login is not None:
        settings["transport/auth/usrpwd/user"] = keys.user(login.agent)
        settings["transport/auth/usrpwd/password"] = login.password
        if is_secret(endpoint) and login.certificates:
            settings |= secret(login.certificates, "connect")
    config = zenoh.Config()
    for name, value in settings.items():
        config.insert_json5(name, json.dumps(value))
    with zenoh.open(config) as session:
        yield session


def speak(world: WorldLink, session: zenoh.Session, agent: int, words: bytes) -> None:
    """Say ``words`` on the intruder's own key until the world has heard them, and nothing spoofed before."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        session.put(keys.tx(SWARM, agent), words)
        message = world.receive(0.1)
        assert message is None or (message[0] == agent and message[1] != b"spoofed")
        if message == (agent, words):
            return
    raise AssertionError("the world does not hear even what it may hear")


def drain(subscriber: Any, until: bytes | None = None) -> list[tuple[str, bytes]]:
    """What a raw subscriber has heard; with ``until``, wait for that payload to come."""
    heard: list[tuple[str, bytes]] = []
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        sample = subscriber.try_recv()
        if sample is not None:
            heard.append((str(sample.key_expr), sample.payload.to_bytes()))
        if (sample is None and until is None) or (heard and heard[-1][1] == until):
            return heard
        if sample is None:
            time.sleep(0.005)
    raise AssertionError(f"{until!r} never came; heard {heard}")


def test_a_thousand_messages_go_both_ways_in_order_and_none_is_lost(world: WorldLink, endpoint: str) -> None:
    in_flight = 8
    with AgentLink(endpoint, LOGINS[1]) as agent:
        for k in range(1000 + in_flight):
            if k < 1000:
                agent.send(b"up %d" % k)
                world.send(1, b"down %d" % k)
            if k >= in_flight:
                assert world.receive(PATIENCE_S) == (1, b"up %d" % (k - in_flight))
                assert agent.receive(PATIENCE_S) == b"down %d" % (k - in_flight)
        assert world.receive(0.0) is None
        assert agent.receive(0.0) is None


def test_the_first_words_of_every_agent_and_the_first_answer_arrive(world: WorldLink, endpoint: str) -> None:
    for k in range(20):
        with AgentLink(endpoint, LOGINS[k % 3]) as agent:
            agent.send(b"here I am")
            assert world.receive(PATIENCE_S) == (k % 3, b"here I am")
            world.send(k % 3, b"I see you")
            assert agent.receive(PATIENCE_S) == b"I see you"


@EVERYWHERE
def test_agents_may_come_by_several_ways(endpoint: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        tcp = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    with (
        WorldLink(CREDENTIALS, [endpoint, tcp]) as world,
        AgentLink(tcp, LOGINS[2]) as one,
        AgentLink(endpoint, LOGINS[1]) as other,
    ):
        for number, agent in ((2, one), (1, other)):
            agent.send(b"from afar")
            assert world.receive(PATIENCE_S) == (number, b"from afar")
            world.send(number, b"welcome")
            assert agent.receive(PATIENCE_S) == b"welcome"


def test_waiting_for_a_message_takes_as_long_as_asked(world: WorldLink, endpoint: str) -> None:
    with AgentLink(endpoint, LOGINS[0]) as agent:
        for receive in (world.receive, agent.receive):
            started = time.monotonic()
            assert receive(0.05) is None
            assert 0.045 < time.monotonic() - started < 0.5


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


def test_a_message_longer_than_the_transport_carries_arrives_whole(world: WorldLink, endpoint: str) -> None:
    with AgentLink(endpoint, LOGINS[1]) as agent:
        for size in (0, 65_000, 65_536, 300_000):
            message = bytes(index % 251 for index in range(size))
            world.send(1, message)
            assert agent.receive(PATIENCE_S) == message


def test_what_is_too_long_or_too_much_is_turned_away_at_the_door(world: WorldLink, endpoint: str) -> None:
    """... and only that of the agent that says it."""
    with (
        AgentLink(endpoint, LOGINS[0]) as honest,
        AgentLink(endpoint, LOGINS[1]) as other,
    ):
        other.send(bytes(messages.MAX_FROM_DRONE + 1))
        other.send(b"short enough")
        assert world.receive(PATIENCE_S) == (1, b"short enough")
        assert world.turned_away(1) == 1
        for _ in range(1000):
            other.send(b"more")
        honest.send(b"heard all the same")
        other.send(b"and last")
        heard = []
        while world.turned_away(1) < 900 or (0, b"heard all the same") not in heard:
            if world.turned_away(1) >= 900:
                heard.append(world.receive(PATIENCE_S))
        assert heard.count((1, b"more")) <= 64
        assert world.turned_away(0) == 0
        world.bar(1)
        other.send(b"no more")
        honest.send(b"still")
        while (said := world.receive(PATIENCE_S)) != (0, b"still"):
            assert said is not None
            assert said[1] != b"no more"


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
    with pytest.raises(zenoh.ZError), intruder(endpoint, None):
        pass


def test_a_world_that_is_not_there_is_named_as_the_trouble(endpoint: str) -> None:
    with pytest.raises(LinkError, match=r"no world answers at .* within 0.2 s: start"):
        AgentLink(endpoint, LOGINS[0], connect_timeout_s=0.2)


@pytest.mark.parametrize(
    ("endpoints", "trouble"),
    [
        ([], "has no endpoint"),
        (["7447"], "'7447' is not an endpoint"),
        (["tcp/127.0.0.1"], "is not an endpoint"),
        (["tcp/127.0.0.1:99999"], "invalid port"),
        (["unixsock-stream//no/such/folder/world.sock"], "No such file or directory"),
    ],
)
def test_a_bad_endpoint_is_one_clear_line(endpoints: list[str], trouble: str) -> None:
    with pytest.raises(LinkError, match=trouble) as caught:
        WorldLink(CREDENTIALS, endpoints)
    assert "tcp/" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert ".rs:" not in str(caught.value)


def test_two_worlds_cannot_share_a_socket(world: WorldLink, endpoint: str) -> None:
    with pytest.raises(LinkError, match="cannot listen"):
        WorldLink(CREDENTIALS, [endpoint])


def test_every_launch_has_fresh_passwords() -> None:
    passwords = [word for _ in range(3) for word in Credentials.fresh(SWARM, 5).passwords]
    assert len(set(passwords)) == 15
    assert min(map(len, passwords)) >= 32


@pytest.mark.parametrize("name", ["", "two words", "a/b", "*", "**", "$", "-dash", "é", "x" * 65])
def test_a_swarm_name_is_one_chunk_of_a_key(name: str) -> None:
    with pytest.raises(ValueError, match="is not a swarm name: use"):
        keys.tx(name, 0)
