"""Certificates at the door: who comes with wrong ones is told what is wrong with them, and nobody poses as anybody else."""

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest
import zenoh

from agent.radio.link import AgentLink
from protocols.wire import keys
from protocols.wire.keys import LinkError
from protocols.wire.login import Login
from tests.world.links import PATIENCE_S, SWARM, intruder, speak
from world.server import link as world_link
from world.server.credentials import Keys, make_keys
from world.server.link import WorldLink

NOW = datetime.now(UTC)
TODAY = make_keys(SWARM, 3, ["127.0.0.1"], 1, NOW)
OTHERS = make_keys(SWARM, 3, ["127.0.0.1"], 1, NOW)
ELSEWHERE = make_keys(SWARM, 3, ["10.0.0.1"], 1, NOW)
OLD = make_keys(SWARM, 3, ["127.0.0.1"], 1, NOW - timedelta(days=9))
EARLY = make_keys(SWARM, 3, ["127.0.0.1"], 1, NOW + timedelta(days=9))


def free(protocol: str) -> str:
    with socket.create_server(("127.0.0.1", 0)) as found:
        return f"{protocol}/127.0.0.1:{found.getsockname()[1]}"


@pytest.fixture(params=["tls", "quic"])
def endpoint(request: pytest.FixtureRequest) -> str:
    return free(request.param)


def told(endpoint: str, login: Login) -> str:
    """Why ``login`` gets no link there."""
    with pytest.raises(LinkError) as caught:
        AgentLink(endpoint, login, connect_timeout_s=0.4)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def as_another_knows_it(own: Keys, other: Keys) -> list[Login]:
    """Logins with the passwords of ``own``, so that only certificates are wrong."""
    return [
        replace(theirs, password=ours.password) for ours, theirs in zip(own.logins, other.logins, strict=True)
    ]


@pytest.mark.parametrize(
    ("logins", "trouble"),
    [
        (OLD, "^agent-1: its certificate has expired"),
        (EARLY, "^agent-1: its certificate is not valid before .*: set the clock"),
    ],
)
def test_a_drone_with_a_certificate_out_of_date_says_so_itself(
    endpoint: str, logins: Keys, trouble: str
) -> None:
    with pytest.raises(LinkError, match=trouble):
        AgentLink(endpoint, logins.logins[1], connect_timeout_s=0.2)


@pytest.mark.parametrize(
    ("world", "trouble"),
    [
        (OLD, "^the world: its certificate has expired"),
        (EARLY, "^the world: its certificate is not valid before .*: set the clock"),
        (ELSEWHERE, r"^the world: its certificate is for 10.0.0.1, not for 127.0.0.1: .*--world 127.0.0.1"),
        (TODAY._replace(world=replace(TODAY.world, certificates=None)), "has no certificate for"),
    ],
)
def test_a_world_with_a_wrong_certificate_does_not_begin(endpoint: str, world: Keys, trouble: str) -> None:
    with pytest.raises(LinkError, match=trouble):
        WorldLink(world.world, [endpoint])


@pytest.mark.parametrize(
    ("world", "login", "trouble"),
    [
        (OTHERS, as_another_knows_it(OTHERS, TODAY)[1], "their keys were not made together"),
        (ELSEWHERE, ELSEWHERE.logins[1], "its certificate is not for 127.0.0.1; connect to an address"),
        (OLD, replace(OLD.logins[1], certificates=None), "has no certificate for"),
        (OLD, OLD.logins[1], "agent-1 does not trust the world at .*: its certificate has expired"),
        (EARLY, EARLY.logins[1], "agent-1 does not trust the world at .*: its certificate is not valid yet"),
        (TODAY, replace(TODAY.logins[1], password="guessed"), "does not let agent-1 in"),
        (
            TODAY,
            replace(TODAY.logins[1], certificates=OTHERS.logins[1].certificates),
            "their keys were not made together",
        ),
    ],
)
def test_what_is_wrong_between_a_drone_and_a_world_is_named(
    monkeypatch: pytest.MonkeyPatch, world: Keys, login: Login, trouble: str
) -> None:
    endpoint = free("tls")
    with monkeypatch.context() as careless:
        careless.setattr(world_link, "_check_endpoints", lambda credentials, endpoints: None)
        careless.setattr("protocols.wire.certificates.refuse_out_of_date", lambda certificates, now: None)
        with WorldLink(world.world, [endpoint]) as link:
            with pytest.raises(LinkError, match=trouble):
                AgentLink(endpoint, login, connect_timeout_s=0.4)
            assert link.receive(0.0) is None


@pytest.mark.parametrize("logins", [OLD, EARLY])
def test_a_world_with_another_clock_is_named(monkeypatch: pytest.MonkeyPatch, logins: Keys) -> None:
    """The drone's certificate is good by its own clock, which is wrong, and bad by the world's."""
    endpoint = free("tls")
    mixed = replace(logins.logins[1].certificates, authority=TODAY.world.certificates.authority)
    monkeypatch.setattr("protocols.wire.certificates.refuse_out_of_date", lambda certificates, now: None)
    monkeypatch.setattr(world_link, "_check_endpoints", lambda credentials, endpoints: None)
    trusting = replace(TODAY.world.certificates, authority=logins.world.certificates.authority)
    with WorldLink(replace(logins.world, certificates=trusting), [endpoint]):
        said = told(endpoint, replace(logins.logins[1], certificates=mixed))
    assert "takes agent-1's certificate for expired or not yet valid: compare the clocks" in said


def test_plain_text_where_tls_is_wanted_is_named() -> None:
    endpoint = free("tls")
    with WorldLink(TODAY.world, [endpoint]):
        plain = endpoint.replace("tls/", "tcp/")
        assert f"the world at {plain} speaks TLS: connect to {endpoint}" in told(plain, TODAY.logins[1])


def test_tls_where_plain_text_is_spoken_is_named() -> None:
    plain = free("tcp")
    with WorldLink(TODAY.world, [plain]):
        secret = plain.replace("tcp/", "tls/")
        assert f"the world at {secret} speaks plain text: let it listen on tls/" in told(
            secret, TODAY.logins[1]
        )


@contextmanager
def listener(answer: Callable[[socket.socket], None]) -> Iterator[str]:
    """Another program on the port."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            while True:
                try:
                    link, _ = server.accept()
                except OSError:
                    return
                with link:
                    answer(link)

        threading.Thread(target=serve, daemon=True).start()
        yield f"tcp/127.0.0.1:{server.getsockname()[1]}"
        server.shutdown(socket.SHUT_RDWR)


def http(link: socket.socket) -> None:
    link.recv(4096)
    link.sendall(b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\n\r\n")


def ssh(link: socket.socket) -> None:
    link.sendall(b"SSH-2.0-OpenSSH_9.2\r\n")


def silent(link: socket.socket) -> None:
    link.settimeout(0.1)
    link.recv(1)


@pytest.mark.parametrize("program", [http, ssh, silent, lambda link: None])
@pytest.mark.parametrize("protocol", ["tcp", "tls"])
def test_another_program_on_the_port_is_not_taken_for_a_world(
    program: Callable[[socket.socket], None], protocol: str
) -> None:
    with listener(program) as endpoint:
        said = told(endpoint.replace("tcp/", f"{protocol}/"), TODAY.logins[0])
    assert "does not answer as a world does: another program has that port" in said


def test_a_certificate_and_anothers_password_are_worth_nothing(endpoint: str) -> None:
    """Who has the certificate of drone 1 and the password of drone 2 is neither: each alone names nobody."""
    mixed = replace(TODAY.logins[1], agent=2, password=TODAY.world.passwords[2])
    with WorldLink(TODAY.world, [endpoint]) as world, AgentLink(endpoint, TODAY.logins[0]) as honest:
        with intruder(endpoint, mixed) as session:
            ears = [session.declare_subscriber(keys.rx(SWARM, agent)) for agent in range(3)]
            for agent in range(3):
                session.put(keys.tx(SWARM, agent), b"spoofed")
            honest.send(b"hello")
            assert world.receive(PATIENCE_S) == (0, b"hello")
            for agent in range(3):
                world.send(agent, b"secret")
            assert honest.receive(PATIENCE_S) == b"secret"
            assert world.receive(0.1) is None
            assert [ear.try_recv() for ear in ears] == [None] * 3
        with intruder(endpoint, TODAY.logins[1]) as session:  # who does have both is heard on the same way
            speak(world, session, 1, b"honest")


def test_without_a_certificate_nobody_gets_in(endpoint: str) -> None:
    bare = replace(TODAY.logins[1], certificates=None)
    with (
        WorldLink(TODAY.world, [endpoint]),
        pytest.raises(zenoh.ZError),
        intruder(endpoint, bare, patience_s=0.5),
    ):
        pass


def test_a_drone_cannot_pose_as_the_world(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even where it is asked for: its certificate opens links and accepts none."""
    monkeypatch.setattr(world_link, "_check_endpoints", lambda credentials, endpoints: None)
    false = replace(TODAY.world, certificates=TODAY.logins[2].certificates)
    with WorldLink(false, [endpoint]):
        told(endpoint, TODAY.logins[1])


def test_the_world_cannot_pose_as_a_drone(endpoint: str) -> None:
    false = replace(TODAY.logins[1], certificates=TODAY.world.certificates)
    with (
        WorldLink(TODAY.world, [endpoint]),
        pytest.raises(zenoh.ZError),
        intruder(endpoint, false, patience_s=0.5),
    ):
        pass


@pytest.mark.parametrize("protocol", ["tls", "quic"])
def test_the_next_world_lets_the_same_drones_in(protocol: str) -> None:
    for _ in range(2):
        endpoint = free(protocol)
        with WorldLink(TODAY.world, [endpoint]) as world, AgentLink(endpoint, TODAY.logins[1]) as drone:
            drone.send(b"again")
            assert world.receive(PATIENCE_S) == (1, b"again")
