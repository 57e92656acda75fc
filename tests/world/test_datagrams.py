"""Datagrams between a drone and the world: sealed for one process, lost without harm, and nobody else's are heard."""

import errno
import queue
import socket
import sys
import time
from collections.abc import Iterator

import pytest

from agent.radio.datagrams import AgentDatagrams
from protocols.wire import datagrams
from protocols.wire.datagrams import Seal
from protocols.wire.keys import LinkError
from tests.fakes.udp import free_ports
from world.server.datagrams import WorldDatagrams

KEY = bytes(range(32))
LONG = bytes(range(1, 256)) * 40


def ends() -> tuple[Seal, Seal]:
    return Seal(KEY, 3, at_world=True), Seal(KEY, 3, at_world=False)


@pytest.mark.parametrize("message", [b"x", b"", b"\x00", LONG])
def test_what_one_end_wraps_the_other_unwraps(message: bytes) -> None:
    world, drone = ends()
    for one, other in ((world, drone), (drone, world)):
        sent = list(one.wrap(message))
        assert max(map(len, sent)) < 1280, "it fits into a packet of every network"
        assert [other.unwrap(data) for data in sent] == [(True, None)] * (len(sent) - 1) + [(True, message)]


def test_nobody_else_can_make_change_repeat_or_turn_around_a_datagram() -> None:
    world, drone = ends()
    (data,) = drone.wrap(b"fly")
    assert drone.unwrap(data) == (False, None), "its own comes back to it"
    for place in range(len(data)):
        changed = bytearray(data)
        changed[place] ^= 1
        assert world.unwrap(bytes(changed)) == (False, None)
    assert Seal(bytes(32), 3, at_world=True).unwrap(data) == (False, None)
    assert world.unwrap(data) == (True, b"fly")
    assert world.unwrap(data) == (False, None), "a second time"
    for _ in range(datagrams._LATE):
        (later,) = drone.wrap(b"fly on")
    assert world.unwrap(later) == (True, b"fly on")
    assert world.unwrap(data) == (False, None), "and much later"


def test_datagrams_out_of_order_are_taken_once_each() -> None:
    world, drone = ends()
    sent = [next(drone.wrap(bytes([number]))) for number in range(1, 9)]
    for place in (0, 4, 2, 4, 7, 1, 2):
        world.unwrap(sent[place])
    assert [world.unwrap(data)[0] for data in sent] == [False, False, False, True, False, True, True, False]


@pytest.mark.parametrize("data", [b"", b"\x03", bytes(9), bytes(10), bytes(5000)])
def test_what_is_no_datagram_is_none(data: bytes) -> None:
    assert ends()[0].unwrap(data) == (False, None)
    assert datagrams.sender_of(data) == (0 if len(data) == 10 else -1)


@pytest.mark.parametrize(
    ("endpoint", "place"),
    [
        ("tcp/10.0.0.1:7447", ("10.0.0.1", 7447)),
        ("tls/world.local:7447#iface=eth0", ("world.local", 7447)),
        ("tcp/[fe80::1]:7447", ("fe80::1", 7447)),
        ("quic/10.0.0.1:7447", ("10.0.0.1", 7448)),
        ("quic/10.0.0.1:65535", ("10.0.0.1", 65534)),
        ("unixsock-stream//run/world.sock", None),
    ],
)
def test_where_a_world_listens_for_datagrams(endpoint: str, place: tuple[str, int] | None) -> None:
    assert datagrams.place_of(endpoint) == place


Met = tuple[WorldDatagrams, "queue.Queue[tuple[int, bytes]]", str]


@pytest.fixture
def world() -> Iterator[Met]:
    endpoint = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    heard: queue.Queue[tuple[int, bytes]] = queue.Queue()
    one = WorldDatagrams([endpoint, "unixsock-stream//nowhere"], lambda *what: heard.put(what))
    yield one, heard, endpoint
    one.close()


def test_the_world_sends_to_where_a_drone_was_last_heard(world: Met) -> None:
    one, heard, endpoint = world
    key = one.offer(3, process=77)
    assert key is not None
    assert one.offer(3, process=77) == key, "a Welcome may have to be said again"
    got: queue.Queue[bytes] = queue.Queue()
    drone = AgentDatagrams(endpoint, 3, key, got.put)
    assert one.send(3, b"where are you") is False
    assert drone.send(b"here") is False, "perhaps nobody hears it"
    assert heard.get(timeout=30) == (3, b"here")
    assert one.send(3, LONG) is True
    assert got.get(timeout=30) == LONG
    assert drone.send(b"again") is True
    drone.close()


def test_who_has_not_the_key_of_this_process_is_not_heard(world: Met) -> None:
    one, heard, endpoint = world
    old = one.offer(3, process=77)
    new = one.offer(3, process=78)
    assert old is not None
    assert new is not None
    assert old != new
    before, stranger, now = (AgentDatagrams(endpoint, 3, key, print) for key in (old, bytes(32), new))
    for each, word in ((before, b"old"), (stranger, b"forged"), (now, b"new")):
        each.send(word)
        each.close()
    assert heard.get(timeout=30) == (3, b"new")
    assert heard.empty()


def test_two_copies_of_a_datagram_at_two_endpoints_at_once_are_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """A network may double what it carries; of a seal that two threads look at, both could find it new."""
    unwrap, inside, most = Seal.unwrap, [0], [0]

    def slowly(self: Seal, datagram: bytes) -> tuple[bool, bytes | None]:
        inside[0] += 1
        most[0] = max(most[0], inside[0])
        time.sleep(0.05)
        inside[0] -= 1
        return unwrap(self, datagram)

    endpoints = [f"tcp/127.0.0.1:{port}" for port in free_ports(2)]
    heard: queue.Queue[tuple[int, bytes]] = queue.Queue()
    one = WorldDatagrams(endpoints, lambda *what: heard.put(what))
    key = one.offer(3, process=77)
    assert key is not None
    monkeypatch.setattr(Seal, "unwrap", slowly)
    (datagram,) = Seal(key, 3, at_world=False).wrap(b"here")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for endpoint in endpoints:
            sender.sendto(datagram, datagrams.place_of(endpoint) or ())
        assert heard.get(timeout=30) == (3, b"here")
        time.sleep(0.2)
    one.close()
    assert most == [1]
    assert heard.empty()


def test_whoever_hears_datagrams_leaves_time_to_the_thread_that_flies(world: Met) -> None:
    """Beside rubbish as fast as a process can send it, commands were 1.7 s old, and all drones were braked."""
    assert sys.getswitchinterval() < 1e-3


def test_a_port_that_is_taken_is_named(world: Met) -> None:
    _, _, endpoint = world
    with pytest.raises(
        LinkError, match=rf"^cannot listen for datagrams of {endpoint}: Address already in use\. "
    ):
        WorldDatagrams([endpoint], print)


def test_a_drone_whose_machine_has_no_socket_left_is_told_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def none_left(*_: object) -> socket.socket:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr("agent.radio.datagrams.socket.socket", none_left)
    with pytest.raises(
        LinkError, match=r"^no datagrams can go to tcp/127\.0\.0\.1:7447: Too many open files$"
    ):
        AgentDatagrams("tcp/127.0.0.1:7447", 0, KEY, print)


def test_without_an_address_there_are_no_datagrams() -> None:
    assert WorldDatagrams(["unixsock-stream//nowhere"], print).offer(0, 1) is None
    with pytest.raises(LinkError, match="has no port for them"):
        AgentDatagrams("unixsock-stream//nowhere", 0, KEY, print)
