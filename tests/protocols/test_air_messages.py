"""What drones and operators say on the air is believed only where it can be."""

import math
import struct
from typing import Any

import pytest

from protocols.wire.beacon import Beacon, BeaconError, pack_beacon, unpack_beacon
from protocols.wire.frames import REASONS
from protocols.wire.nature import Nature, NatureError, pack_nature, pack_status, unpack_nature, unpack_status
from protocols.wire.operator import OperatorError, Order, Word, pack_word, unpack_word
from protocols.wire.status import SWAP_COUNTS, AgentStatus

BEACON = Beacon(3, 4, 2, 77, 10**15, (1.0, -2.0, 0.5), (0.0, 1.0, 0.0), 12, 1, -3, 90, True)
WORD = Word(5, Order.GO, 10**11, 10**15)


@pytest.mark.parametrize(
    "wrong",
    [
        {"tick": -2}, {"utc_us": -1}, {"utc_us": 1 << 62}, {"battery": 101}, {"p": (20_000.0, 0.0, 0.0)},
        {"p": (math.nan, 0.0, 0.0)}, {"v": (0.0, 0.0, math.inf)}, {"v": (0.0, 2_000.0, 0.0)},
    ],
    ids=str,
)  # fmt: skip
def test_a_beacon_that_says_what_cannot_be_is_none(wrong: dict[str, Any]) -> None:
    assert unpack_beacon(pack_beacon(BEACON, b"frame")) == (BEACON, b"frame")
    with pytest.raises(BeaconError):
        unpack_beacon(pack_beacon(BEACON._replace(**wrong)))


@pytest.mark.parametrize(
    "wrong", [{"at_tick": -1}, {"at_tick": 1 << 62}, {"utc_us": -1}, {"utc_us": 1 << 62}], ids=str
)
def test_a_word_that_says_what_cannot_be_is_none(wrong: dict[str, Any]) -> None:
    assert unpack_word(pack_word(WORD)) == WORD
    with pytest.raises(OperatorError):
        unpack_word(pack_word(WORD._replace(**wrong)))


@pytest.mark.parametrize(("place", "value"), [(0, 2), (1, len(Order))], ids=["version", "order"])
def test_a_word_of_another_version_or_order_is_none(place: int, value: int) -> None:
    said = bytearray(pack_word(WORD))
    struct.pack_into("B", said, place, value)
    with pytest.raises(OperatorError):
        unpack_word(bytes(said))


NATURE = Nature("a" * 16, "b" * 16, 0.0, [(1.0, -2.0, 0.5)])
STATUS = AgentStatus(1, 2, (0,) * len(REASONS), (0,) * len(SWAP_COUNTS), 7, bytes([0, 1, 2]))


@pytest.mark.parametrize(
    "wrong",
    [
        {"sigma_m": 2.0}, {"sigma_m": math.nan}, {"seen": [(math.nan, 0.0, 1.0)]}, {"seen": [(0.0, 20_000.0, 1.0)]},
        {"seen": [(0.0, 0.0, 0.0)]}, {"seen": [(0.0, 0.0, math.inf)]},
    ],
    ids=str,
)  # fmt: skip
def test_a_world_that_says_what_cannot_be_says_nothing(wrong: dict[str, Any]) -> None:
    assert unpack_nature(pack_nature(NATURE)) == NATURE
    with pytest.raises(NatureError):
        unpack_nature(pack_nature(NATURE._replace(**wrong)))


def test_a_world_is_cut_short_to_what_a_drone_can_see() -> None:
    assert len(unpack_nature(pack_nature(NATURE._replace(seen=[(1.0, 2.0, 0.5)] * 20))).seen) == 16


@pytest.mark.parametrize(
    "data", [b"", b"\x01" * 60, pack_nature(NATURE)[:-1], pack_nature(NATURE) + b"x"], ids=repr
)
def test_bytes_that_are_no_news_of_a_world(data: bytes) -> None:
    with pytest.raises(NatureError):
        unpack_nature(data)


@pytest.mark.parametrize(
    "data", [b"", b"\xc1", b"x" * 5000, pack_status(STATUS)[:-1], b"\x93\x01\x02\x03"], ids=len
)
def test_bytes_that_are_no_account_of_slots(data: bytes) -> None:
    assert unpack_status(pack_status(STATUS), 3) == STATUS
    with pytest.raises(NatureError):
        unpack_status(data, 3)
