"""What a drone reports about itself to whoever runs the flight: for the view, the report and the invariants."""

from collections.abc import Iterable
from typing import Any, NamedTuple

from protocols.slots.written import unpack_slots
from protocols.wire.frames import REASONS

STATUS_EVERY = 50  # ticks between two accounts of one drone when nothing changes

SWAP_COUNTS = (
    "proposed",
    "committed",
    "accepted",
    "refused",
    "withdrawn",
    "timed_out",
    "vacated",
    "undone",
    "unsealed",
)


class AgentStatus(NamedTuple):
    """One drone's account of itself since its boot.

    heard: neighbours whose frames are fresh. rejected: frames dropped on receipt, per `REASONS`. swaps: per `SWAP_COUNTS`.
    digest: of its swap set; view: its slot_of (protocols.slots.written).
    """

    slot: int
    heard: int
    rejected: tuple[int, ...]
    swaps: tuple[int, ...]
    digest: int
    view: bytes


def all_swaps(statuses: Iterable[AgentStatus]) -> dict[str, int]:
    """What these drones together count of their swaps, by `SWAP_COUNTS`."""
    each = [status.swaps for status in statuses] or [(0,) * len(SWAP_COUNTS)]
    return dict(zip(SWAP_COUNTS, map(sum, zip(*each, strict=True)), strict=True))


def is_due(tick: int, changed: bool) -> bool:
    """Whether a drone gives an account of itself at this tick: when its view of the slots has ``changed``, and now and then."""
    return changed or tick % STATUS_EVERY == 0


def parse_status(fields: Any, agents: int) -> AgentStatus:
    """The status a drone sent.

    Raises:
        ValueError: malformed.
    """
    if not isinstance(fields, list) or len(fields) != 6:
        raise ValueError("a status has six fields")
    slot, heard, rejected, swaps, digest, view = fields
    if not isinstance(rejected, list) or not isinstance(swaps, list):
        raise ValueError("a status lists its counts")
    status = AgentStatus(slot, heard, tuple(rejected), tuple(swaps), digest, view)
    numbers = (status.slot, status.heard, *status.rejected, *status.swaps, status.digest)
    if not all(type(number) is int and number >= 0 for number in numbers):
        raise ValueError("a status counts in whole numbers")
    if len(status.rejected) != len(REASONS) or len(status.swaps) != len(SWAP_COUNTS):
        raise ValueError("a status of another version")
    if status.slot >= agents:
        raise ValueError("a status of a slot that there is not")
    unpack_slots(status.view, agents)
    return status
