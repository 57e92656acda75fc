"""What a drone and its radio host say to each other is read as it was written, and nothing else is read at all."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols.wire.vehicles import (
    FARTHEST,
    WORDS,
    Account,
    Ill,
    Kind,
    Mode,
    Order,
    VehicleMessageError,
    account_key,
    dongle_of,
    fix_key,
    name_of,
    order_key,
    pack_account,
    pack_fix,
    pack_order,
    unpack_account,
    unpack_fix,
    unpack_order,
)

number = st.floats(-FARTHEST, FARTHEST, width=32)
vector = st.tuples(number, number, number)
share = st.floats(0, 1, width=32)
ORDER = pack_order(Order(Kind.FLY, 1))


@given(st.builds(Order, st.sampled_from(Kind), st.integers(0, 2**32 - 1), vector, vector, vector, number))
def test_an_order_is_read_as_it_was_written(order: Order) -> None:
    assert unpack_order(pack_order(order)) == order


ages = st.floats(0, 900, width=32) | st.just(math.inf)
accounts = st.builds(
    Account, st.sampled_from(Mode), st.integers(0, 9), st.booleans(), st.sampled_from(Ill), vector, vector, number, number,
    ages, share,
)  # fmt: skip


@given(accounts)
def test_an_account_is_read_as_it_was_written(account: Account) -> None:
    assert unpack_account(pack_account(account)) == account


@given(vector)
def test_a_position_is_read_as_it_was_written(p: tuple[float, float, float]) -> None:
    assert unpack_fix(pack_fix(p)) == p


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"", "0 bytes are no order of a vehicle"),
        (ORDER + b"\0", "bytes are no order of a vehicle"),
        (b"\2" + ORDER[1:], "of version 2: this one reads 1"),
        (ORDER[:1] + b"\7" + ORDER[2:], "7 is no kind of order"),
        (ORDER[:-4] + struct.pack("<f", math.nan), "nan in a vehicle's order"),
        (ORDER[:-4] + struct.pack("<f", -math.inf), "-inf in a vehicle's order"),
        (ORDER[:-4] + struct.pack("<f", 1001.0), "1001 in a vehicle's order"),
    ],
)
def test_what_is_no_order_is_refused(data: bytes, why: str) -> None:
    with pytest.raises(VehicleMessageError, match=why):
        unpack_order(data)


def test_keys_name_the_drone_and_its_vehicle() -> None:
    uri, other = "radio://0/80/2M/E7E7E7E703", "radio://0/80/2M/E7E7E7E704"
    assert order_key("rsc", 3, uri) == f"rsc/body/3/{name_of(uri)}/setpoint"
    assert account_key("rsc", 3, uri) == f"rsc/body/3/{name_of(uri)}/state"
    assert fix_key("rsc", 3) == "rsc/body/3/position"
    assert name_of(uri) != name_of(other)
    assert len(name_of(uri)) == 8


def test_there_are_words_for_all_that_can_be_wrong() -> None:
    assert set(WORDS) == set(Ill)


@pytest.mark.parametrize(
    ("uri", "dongle"),
    [
        ("radio://0/80/2M/E7E7E7E701", 0),
        ("radio://3/2/250K", 3),
        ("udp://127.0.0.1:19850", 0),
        ("usb://0", 0),
    ],
)
def test_the_address_of_a_crazyflie_names_its_dongle(uri: str, dongle: int) -> None:
    assert dongle_of(uri) == dongle


@pytest.mark.parametrize(
    "uri",
    ["", "radio://", "radio://0/80/3M/E7E7E7E701", "radio://0/80/2M/XYZ", "radio://²/80/2M", "serial://x"],
)
def test_what_is_no_address_of_a_crazyflie_is_refused_with_one_that_is(uri: str) -> None:
    with pytest.raises(ValueError, match="one reads radio://0/80/2M/E7E7E7E701"):
        dongle_of(uri)
