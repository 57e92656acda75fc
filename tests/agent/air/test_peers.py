"""On the air nobody is heard in another's name, and strangers are not heard at all."""

import itertools
import os
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack
from datetime import UTC, datetime

import pytest

from agent.air.listening import check_free
from agent.air.peers import OPERATOR, AirLink, End, Said, end_of, name_of
from protocols.fleet.document import parse_fleet
from protocols.wire.certificates import make_peer_certificates
from protocols.wire.keys import LinkError, user
from protocols.wire.login import Certificates
from protocols.wire.nature import WORLD

_ports = itertools.count(15000 + os.getpid() % 190 * 5)  # a listener has a second port, 1000 further up
HERE, NOW = "127.0.0.1", datetime.now(UTC)
HEARS = [("0", "beacon"), ("1", "beacon"), (OPERATOR, "word")]


def keys() -> dict[str, Certificates]:
    return make_peer_certificates("rsc", {OPERATOR: HERE, user(0): HERE, user(1): HERE}, 1, NOW)


class Band:
    """Who is on the air, closed at the end of a test."""

    def __init__(self) -> None:
        self._links, self.addresses = ExitStack(), []

    def join(self, who: str, own: Certificates | None) -> AirLink:
        address = f"{'quic' if own else 'udp'}/{HERE}:{next(_ports)}"
        link = AirLink("rsc", End(who, address, list(self.addresses), HEARS), own, 2)
        self.addresses.append(address)
        return self._links.enter_context(link)

    def close(self) -> None:
        self._links.close()


@pytest.fixture
def band() -> Iterator[Band]:
    band = Band()
    yield band
    band.close()


def heard_by(
    link: AirLink, speakers: list[tuple[AirLink, bytes]], wanted: int, patience_s: float
) -> list[Said]:
    """What ``link`` hears while all ``speakers`` say beacons and words, until it has heard ``wanted`` of them."""
    heard: list[Said] = []
    deadline = time.monotonic() + patience_s
    while len({said.data for said in heard}) < wanted and time.monotonic() < deadline:
        for speaker, data in speakers:
            for kind in ("beacon", "word"):
                speaker.say(kind, data)
        time.sleep(0.05)
        heard += link.hear()
    return heard


@pytest.mark.parametrize("secret", [False, True], ids=["udp", "quic"])
def test_all_hear_each_other(band: Band, secret: bool) -> None:
    own = keys() if secret else {}
    zero = band.join(name_of(0), own.get(user(0)))
    one = band.join(name_of(1), own.get(user(1)))
    operator = band.join(OPERATOR, own.get(OPERATOR))
    heard = heard_by(zero, [(one, b"1"), (operator, b"g")], 2, 20.0)
    assert {(said.who, said.kind, said.data) for said in heard} == {
        ("1", "beacon", b"1"),
        (OPERATOR, "word", b"g"),
    }
    assert all(abs(said.at_us / 1e6 - time.time()) < 30 for said in heard)


def test_who_speaks_in_anothers_name_is_not_heard(band: Band) -> None:
    """The certificate of drone 1, and the names of drone 0 and of the operator."""
    own = keys()
    operator = band.join(OPERATOR, own[OPERATOR])
    zero, posing = band.join(name_of(0), own[user(0)]), band.join(OPERATOR, own[user(1)])
    honest = band.join(name_of(1), own[user(1)])
    heard = heard_by(zero, [(posing, b"forged"), (honest, b"1"), (operator, b"g")], 2, 20.0)
    heard += heard_by(zero, [(posing, b"forged")], 9, 0.5)
    assert {said.data for said in heard} == {b"1", b"g"}


def test_who_has_keys_of_another_authority_is_not_linked(band: Band) -> None:
    own, others = keys(), keys()
    zero = band.join(name_of(0), own[user(0)])
    stranger, one = band.join(name_of(1), others[user(1)]), band.join(name_of(1), own[user(1)])
    heard = heard_by(zero, [(stranger, b"stranger"), (one, b"1")], 1, 20.0)
    heard += heard_by(zero, [(stranger, b"stranger")], 9, 1.0)
    assert {said.data for said in heard} == {b"1"}


@pytest.mark.parametrize("both_look", [True, False], ids=["the other looks, too", "by its second port"])
def test_who_falls_silent_amid_a_handshake_keeps_nobody_apart(both_look: bool) -> None:
    """A listener takes one at a time, and waits for half a minute: for a drone that was cut off just then, or a stranger."""
    at = [f"quic/{HERE}:{next(_ports)}" for _ in range(3)]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind((HERE, 0))
        silent.settimeout(10.0)
        whom = f"quic/{HERE}:{silent.getsockname()[1]}"
        with AirLink("rsc", End(name_of(1), at[2], [whom]), keys()[user(1)], 2):
            begins = silent.recv(2048)
        own = keys()
        whom_zero_looks_for = [at[1]] if both_look else []
        with AirLink("rsc", End(name_of(0), at[0], whom_zero_looks_for, HEARS), own[user(0)], 2) as zero:
            silent.sendto(begins, (HERE, int(at[0].rpartition(":")[2])))
            time.sleep(0.2)
            with AirLink("rsc", End(name_of(1), at[1], [at[0]], HEARS), own[user(1)], 2) as one:
                assert heard_by(zero, [(one, b"1")], 1, 10.0)
                assert b"0" in {said.data for said in heard_by(one, [(zero, b"0")], 2, 10.0)}


@pytest.mark.parametrize("mixed", [False, True], ids=["drones", "mixed reality"])
def test_of_two_who_are_to_be_linked_each_looks_for_the_other(mixed: bool) -> None:
    fleet = parse_fleet(
        {
            "mission": "lab.yaml",
            "origin_m": [0, 0],
            "fence": {"x_m": [-1, 9], "y_m": [-1, 1]},
            "drones": [{"number": number, "start_m": [number, 0]} for number in range(3)],
            **({"world": {}} if mixed else {}),
        }
    )
    names = [OPERATOR, *([WORLD] if mixed else []), *map(name_of, range(3))]
    ends = {who: end_of(fleet, who) for who in names}
    for one, other in itertools.combinations(names, 2):
        looks = ends[other].listen in ends[one].connect
        assert looks == (ends[one].listen in ends[other].connect)
        assert looks == (not mixed or bool({one, other} & {OPERATOR, WORLD}))


def test_an_address_that_is_taken_is_told(band: Band) -> None:
    band.join(name_of(0), None)
    with pytest.raises(
        LinkError, match=r"cannot listen at udp/127.0.0.1:\d+: another program does. Is this fleet in the air"
    ):
        AirLink("rsc", End(name_of(1), band.addresses[0]))


@pytest.mark.parametrize("protocol", ["udp", "quic", "tcp", "tls"])
def test_an_address_of_no_machine_or_of_another_is_told(protocol: str) -> None:
    for host, why in (
        ("203.0.113.9", "Cannot assign requested address"),
        ("nowhere.invalid", ""),
        ("10.0.0..1", "no machine can be called so"),
    ):
        address = f"{protocol}/{host}:7450"
        with pytest.raises(
            LinkError, match=rf"cannot listen at {address} \({why}.*\): give an address of this machine"
        ):
            check_free(address)


def test_what_was_closed_a_moment_ago_is_free() -> None:
    with socket.create_server((HERE, 0)) as server:
        port = server.getsockname()[1]
        with socket.create_connection((HERE, port)) as one:
            server.accept()[0].close()
            with pytest.raises(LinkError, match="another program does"):
                check_free(f"tcp/{HERE}:{port}")
            one.close()
    check_free(f"tcp/{HERE}:{port}")


@pytest.mark.parametrize("secret", [False, True], ids=["udp", "quic"])
def test_who_floods_is_heard_no_more_than_others_and_takes_nothing_from_them(
    band: Band, secret: bool
) -> None:
    own = keys() if secret else {}
    zero, flooding = band.join(name_of(0), own.get(user(0))), band.join(name_of(1), own.get(user(1)))
    operator = band.join(OPERATOR, own.get(OPERATOR))
    assert heard_by(zero, [(flooding, b"1"), (operator, b"g")], 2, 20.0)
    begun, said, words, flood = time.monotonic(), 0, 0, []
    while time.monotonic() - begun < 1.0:
        for _ in range(100):
            flooding.say("beacon", bytes(1000))
        operator.say("word", b"%d" % said)
        said += 1
        heard = zero.hear()
        assert len(heard) < 200
        words += sum(each.who == OPERATOR for each in heard)
        flood += [each for each in heard if each.who == "1"]
    time.sleep(0.2)
    words += sum(each.who == OPERATOR for each in zero.hear())
    assert words > 0.5 * min(said, 64)
    assert len(flood) < 1500


def test_who_declares_without_end_is_not_listened_to(band: Band) -> None:
    """But for what there is; each would else take 2 kB of everybody's memory."""
    own = keys()
    zero, one = band.join(name_of(0), own[user(0)]), band.join(name_of(1), own[user(1)])
    assert heard_by(zero, [(one, b"1")], 1, 20.0)
    kept = [one._session.declare_subscriber(f"rsc/air/{n}x/beacon", lambda sample: None) for n in range(50)]
    publisher = zero._session.declare_publisher("rsc/air/7x/beacon")
    honest = zero._session.declare_publisher("rsc/air/0/beacon")
    time.sleep(0.5)
    assert honest.matching_status.matching
    assert not publisher.matching_status.matching
    assert kept
