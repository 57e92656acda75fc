"""What the operator says to all drones, and how: a short record, said again and again until there is a newer one.

So an order may get lost on the way: the next record brings it. And who hears no record hears that the operator is gone.
"""

import struct
from enum import StrEnum
from typing import NamedTuple

VERSION = 1
_RECORD = struct.Struct("<BBIqq")
_LATEST = 1 << 62


class Order(StrEnum):
    """What an operator can order."""

    NONE = "none"
    ARM = "arm"
    TAKEOFF = "takeoff"
    GO = "go"
    HOLD = "hold"
    LAND = "land"
    ABORT = "abort"
    KILL = "kill"


_ORDERS = tuple(Order)


class OperatorError(ValueError):
    """No word of an operator."""


class Word(NamedTuple):
    """number: of the order, counted up from the operator's start (its time in ms, so that a restarted one counts on).
    at_tick: of UTC, for `go`: when the target starts. utc_us: when it was said.
    """

    number: int
    order: Order
    at_tick: int
    utc_us: int


def pack_word(word: Word) -> bytes:
    """As it travels."""
    return _RECORD.pack(
        VERSION, _ORDERS.index(word.order), word.number & 0xFFFFFFFF, word.at_tick, word.utc_us
    )


def unpack_word(data: bytes) -> Word:
    """What an operator said.

    Raises:
        OperatorError: nothing.
    """
    if len(data) != _RECORD.size:
        raise OperatorError(f"{len(data)} bytes are no word of an operator")
    version, order, number, at_tick, utc_us = _RECORD.unpack(data)
    if version != VERSION or order >= len(_ORDERS) or not 0 <= at_tick < _LATEST or not 0 <= utc_us < _LATEST:
        raise OperatorError("no word of an operator of this version")
    return Word(number, _ORDERS[order], at_tick, utc_us)
