"""On the air nobody is heard in another's name, and strangers are not heard at all."""

import itertools
import os
import time
from collections.abc import Iterator
from contextlib import ExitStack
from datetime import UTC, datetime

import pytest

from agent.air.peers import OPERATOR, AirLink, End, Said, name_of
from protocols.wire.certificates import make_peer_certificates
from protocols.wire.keys import LinkError, user
from protocols.wire.login import Certificates

_ports = itertools.count(15000 + os.getpid() % 1000 * 5)
HERE, NOW = "127.0.0.1", datetime.now(UTC)


def keys() -> dict[str, Certificates]:
    return make_peer_certificates("rsc", {OPERATOR: HERE, user(0): HERE, user(1): HERE}, 1, NOW)


class Band:
    """Who is on the air, closed at the end of a test."""

    def __init__(self) -> None:
        self._links, self.addresses = ExitStack(), []

    def join(self, who: str, own: Certificates | None) -> AirLink:
        address = f"{'quic' if own else 'udp'}/{HERE}:{next(_ports)}"
        link = AirLink("rsc", End(who, address, list(self.addresses)), own, 2)
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
    """What ``link`` hears while all ``speakers`` say beacons, until it has heard ``wanted`` of them."""
    heard: list[Said] = []
    deadline = time.monotonic() + patience_s
    while len({said.data for said in heard}) < wanted and time.monotonic() < deadline:
        for speaker, data in speakers:
            speaker.say("beacon", data)
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
        (OPERATOR, "beacon", b"g"),
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


def test_an_address_that_is_taken_is_told(band: Band) -> None:
    band.join(name_of(0), None)
    with pytest.raises(LinkError, match=r"cannot listen at udp/127.0.0.1"):
        AirLink("rsc", End(name_of(1), band.addresses[0]))
