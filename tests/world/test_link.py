"""The wire between a world and its drones, over a Unix socket and over TLS: what is said arrives, whole and in order."""

import socket
import threading
import time

import pytest

from agent.radio.link import AgentLink
from protocols.wire import keys, messages
from protocols.wire.keys import LinkError
from tests.world.links import CREDENTIALS, LOGINS, PATIENCE_S
from world.server.link import WorldLink

EVERYWHERE = pytest.mark.parametrize("endpoint", ["unixsock-stream", "tls", "quic"], indirect=True)


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
            assert 0.045 < time.monotonic() - started < 5.0


def test_a_message_longer_than_the_transport_carries_arrives_whole(world: WorldLink, endpoint: str) -> None:
    with AgentLink(endpoint, LOGINS[1]) as agent:
        for size in (0, 65_000, 65_536, 300_000):
            message = bytes(index % 251 for index in range(size))
            world.send(1, message)
            assert agent.receive(PATIENCE_S) == message


def test_what_is_too_long_is_turned_away_at_the_door(world: WorldLink, endpoint: str) -> None:
    """... and only that of the agent that says it."""
    with (
        AgentLink(endpoint, LOGINS[0]) as honest,
        AgentLink(endpoint, LOGINS[1]) as other,
    ):
        other.send(bytes(messages.MAX_FROM_DRONE + 1))
        other.send(b"short enough")
        assert world.receive(PATIENCE_S) == (1, b"short enough")
        assert (world.turned_away(0), world.turned_away(1)) == (0, 1)
        world.bar(1)
        other.send(b"no more")
        honest.send(b"still")
        assert world.receive(PATIENCE_S) == (0, b"still")


def test_while_too_much_waits_at_the_door_it_waits_at_the_other_end(world: WorldLink, endpoint: str) -> None:
    """So nobody fills the world's memory, and nothing is lost."""
    count, said = 10_000, []
    with AgentLink(endpoint, LOGINS[1]) as other:

        def flood() -> None:
            for number in range(count):
                other.send(b"%4000d" % number)
                said.append(number)

        flooding = threading.Thread(target=flood)
        flooding.start()
        time.sleep(1.0)
        assert len(said) < count - 1000
        for number in range(count):
            assert world.receive(PATIENCE_S) == (1, b"%4000d" % number)
        flooding.join()


def test_a_world_that_is_not_there_is_named_as_the_trouble(endpoint: str) -> None:
    with pytest.raises(LinkError, match=r"no world answers at .* within 0.2 s: start"):
        AgentLink(endpoint, LOGINS[0], connect_timeout_s=0.2)


@pytest.mark.parametrize(
    ("endpoints", "trouble"),
    [
        ([], "has no endpoint"),
        (["7447"], "'7447' is not an endpoint"),
        (["tcp/127.0.0.1"], "is not an endpoint"),
        (["tcp/127.0.0.1:99999"], "ports go from 1 to 65535"),
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


@pytest.mark.parametrize("name", ["", "two words", "a/b", "*", "**", "$", "-dash", "é", "x" * 65])
def test_a_swarm_name_is_one_chunk_of_a_key(name: str) -> None:
    with pytest.raises(ValueError, match="is not a swarm name: use"):
        keys.tx(name, 0)
