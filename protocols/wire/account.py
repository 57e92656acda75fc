"""What a drone on the air tells the operator of itself a few times a second, as JSON."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field, TypeAdapter, ValidationError

MAX_ACCOUNT_BYTES = 16384
Short = Annotated[str, Field(max_length=200)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


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

    drone: int
    phase: Short
    mode: Short
    complaints: tuple[Short, ...]
    reasons: tuple[Short, ...]
    heard: tuple[int, ...]
    clock_ms: Finite | None
    slot: int
    ticks: int
    missed: int
    rejected: int
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
