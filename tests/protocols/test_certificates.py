"""Certificates of a swarm: what is made is good, what is not whole or not one's own is refused, whatever it is."""

from contextlib import suppress
from dataclasses import fields, replace
from datetime import UTC, datetime, timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols.wire.certificates import (
    WORLD,
    checked_certificates,
    make_certificates,
    read_login,
    refuse_other_address,
    refuse_out_of_date,
)
from protocols.wire.endpoints import (
    PlainTextError,
    checked_endpoint,
    is_secret,
    refuse_plain_text,
    split,
    stays_here,
)
from protocols.wire.keys import LinkError, user
from protocols.wire.login import Certificates, Login

NOW = datetime(2030, 6, 1, tzinfo=UTC)
MADE = make_certificates("rsc", 3, ["10.0.0.1", "fe80::1", "world.example"], 30, NOW)
OTHERS = make_certificates("rsc", 3, ["10.0.0.1"], 30, NOW)
OWN = MADE.agents[1]
LOGIN = Login("rsc", 1, "secret", OWN)
PARTS = [field.name for field in fields(Certificates)]


def test_what_was_made_is_good_for_whom_it_was_made() -> None:
    for agent, certificates in enumerate(MADE.agents):
        checked_certificates(certificates, user(agent))
    checked_certificates(MADE.world, WORLD)
    for address in ("10.0.0.1", "fe80::1", "FE80:0::1", "world.example", "World.Example"):
        refuse_other_address(MADE.world, address)


@pytest.mark.parametrize(
    ("certificates", "trouble"),
    [
        (MADE.agents[2], "that of 'agent-2', not of 'agent-1'"),
        (MADE.world, "that of 'world', not of 'agent-1'"),
        (replace(OWN, authority=OTHERS.world.authority), "not signed by its authority"),
        (replace(OWN, private_key=MADE.agents[2].private_key), "belongs to another certificate"),
        (replace(OWN, certificate=OWN.certificate + MADE.world.certificate), "damaged"),
        (replace(OWN, authority=""), "damaged"),
        (replace(OWN, certificate=OWN.private_key), "damaged"),
        (replace(OWN, private_key=OWN.certificate), "damaged"),
        (replace(OWN, private_key=f"\n{OWN.private_key}"), "damaged"),
    ],
)
def test_what_is_not_ones_own_is_refused_and_named(certificates: Certificates, trouble: str) -> None:
    with pytest.raises(ValueError, match=trouble) as told:
        read_login(replace(LOGIN, certificates=certificates).to_json())
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("part", PARTS)
@given(data=st.data())
def test_a_certificate_that_was_tampered_with_is_refused(part: str, data: st.DataObject) -> None:
    text = getattr(OWN, part)
    place = data.draw(st.integers(0, len(text) - 1))
    wrong = text[:place] + data.draw(st.text("Aa0/+=- \n", max_size=3)) + text[place + 1 :]
    if wrong == text:
        return
    with pytest.raises(ValueError, match=r"^its "):
        checked_certificates(replace(OWN, **{part: wrong}), user(1))


@given(st.text(), st.text(), st.text())
def test_whatever_is_no_certificate_is_refused(authority: str, certificate: str, key: str) -> None:
    with pytest.raises(ValueError, match="damaged"):
        checked_certificates(Certificates(authority, certificate, key), user(1))


@pytest.mark.parametrize(
    ("days", "trouble"),
    [
        (-2.0, "not valid before 2030-05-31 .* clock says 2030-05-30 .*: set the clock"),
        (-0.9, None),
        (29.9, None),
        (30.1, "expired: it was valid until 2030-07-01"),
    ],
)
def test_dates_are_compared_with_the_clock(days: float, trouble: str | None) -> None:
    if trouble is None:
        refuse_out_of_date(OWN, NOW + timedelta(days=days))
        return
    with pytest.raises(ValueError, match=trouble):
        refuse_out_of_date(OWN, NOW + timedelta(days=days))


@pytest.mark.parametrize("host", ["10.0.0.2", "other.example", "example", ""])
def test_a_world_is_not_where_its_certificate_is_not_for(host: str) -> None:
    with pytest.raises(ValueError, match=r"is for 10.0.0.1, fe80::1, world.example, not for"):
        refuse_other_address(MADE.world, host)
    with pytest.raises(ValueError, match=r"is for no address"):
        refuse_other_address(OWN, host)


@pytest.mark.parametrize("address", ["", "10.0.0.1:7447", "tls/10.0.0.1", "a b", "*.example", "a..b", "é"])
def test_what_is_no_address_gets_no_certificate(address: str) -> None:
    with pytest.raises(ValueError, match="is not an address of the world: give"):
        make_certificates("rsc", 1, [address], 30, NOW)


def test_secrets_do_not_show_when_a_login_is_printed() -> None:
    assert "secret" not in repr(LOGIN)
    assert OWN.private_key.splitlines()[1] not in repr(LOGIN)


@pytest.mark.parametrize(
    ("endpoint", "secret", "here"),
    [
        ("unixsock-stream//run/world.sock", False, True),
        ("tcp/127.0.0.1:7447", False, True),
        ("tcp/127.9.9.9:7447", False, True),
        ("tcp/[::1]:7447", False, True),
        ("ws/localhost:7447", False, True),
        ("tcp/0.0.0.0:7447", False, False),
        ("tcp/[::]:7447", False, False),
        ("tcp/10.0.0.1:7447", False, False),
        ("ws/10.0.0.1:7447", False, False),
        ("tcp/localhost.example:7447", False, False),
        ("tls/10.0.0.1:7447", True, False),
        ("quic/[fe80::1]:7447", True, False),
        ("tls/127.0.0.1:7447#iface=lo", True, True),
    ],
)
def test_plain_text_leaves_this_machine_only_by_an_explicit_word(
    endpoint: str, secret: bool, here: bool
) -> None:
    assert (is_secret(endpoint), stays_here(endpoint)) == (secret, here)
    if secret or here:
        refuse_plain_text(endpoint)
        return
    with pytest.raises(PlainTextError, match=r"plain text.*rsc-swarm keys.*use tls/.*--plain-text"):
        refuse_plain_text(endpoint)


@given(
    st.text() | st.from_regex(r"(tcp|tls|quic|ws|unixsock-stream)/.{0,20}(:\d{1,6})?.{0,5}", fullmatch=True)
)
def test_an_endpoint_is_one_or_it_is_refused(text: str) -> None:
    with suppress(LinkError):
        protocol, host, port = split(checked_endpoint(text))
        assert text.startswith(f"{protocol}/")
        assert host in text
        assert (0 < port < 65536) == (protocol != "unixsock-stream")


@pytest.mark.parametrize("port", ["0", "65536", "1" + 30 * "0", 5000 * "1", "²", "7447x", "7447 "])
def test_who_cannot_be_reached_has_no_endpoint(port: str) -> None:
    with pytest.raises(LinkError, match=r"is not an endpoint: .*; ports go from 1 to 65535$"):
        split(f"tcp/127.0.0.1:{port}")
