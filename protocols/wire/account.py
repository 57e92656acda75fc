"""What a drone on the air tells the operator of itself a few times a second, as JSON."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import AfterValidator, Field, TypeAdapter, ValidationError

from protocols.printable import printable
from protocols.wire.keys import MAX_AGENTS

MAX_ACCOUNT_BYTES = 16384
_LONGEST = 200


def shown(text: str) -> str:
    """As a text may stand in an account."""
    return printable(text)[:_LONGEST]


def _checked(text: str) -> str:
    if shown(text) != text:
        raise ValueError("not printable")
    return text


Short = Annotated[str, Field(max_length=_LONGEST), AfterValidator(_checked)]
Finite = Annotated[float, Field(ge=-1e12, le=1e12, allow_inf_nan=False)]
Number = Annotated[int, Field(ge=0, le=MAX_AGENTS)]
Count = Annotated[int, Field(ge=0, le=10**9)]


class AccountError(ValueError):
    """No account of a drone."""


@dataclass(frozen=True)
class Account:
    """A drone's account of itself.

    Attributes:
        complaints: what speaks against arming it. reasons: for its last change of phase. heard: the drones it hears.
        clock_ms: its clock minus the median of the others. ticks, missed: of the mission, flown and missed.
        rejected: frames heard and not believed. fleet, mission, version: of what it flies.
    """

    drone: Number
    phase: Short
    mode: Short
    complaints: tuple[Short, ...]
    reasons: tuple[Short, ...]
    heard: tuple[Number, ...]
    clock_ms: Finite | None
    slot: Number
    ticks: Count
    missed: Count
    rejected: Count
    fleet: Short
    mission: Short
    version: Short

    def to_json(self) -> bytes:
        return _ACCOUNT.dump_json(self)


_ACCOUNT = TypeAdapter(Account)


def read_account(data: bytes) -> Account:
    """What ``to_json`` wrote.

    Raises:
        AccountError: it is none.
    """
    if len(data) > MAX_ACCOUNT_BYTES:
        raise AccountError("longer than an account may be")
    try:
        return _ACCOUNT.validate_json(data, strict=True)
    except ValidationError as error:
        raise AccountError(f"no account of a drone ({error.error_count()} faults)") from None
