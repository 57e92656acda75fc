"""An assignment of slots as bytes: one for each drone where that is enough, else two, the lower first."""

import struct
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_ONE_BYTE = 256  # drones, at most


def pack_slots(slot_of: Sequence[int]) -> bytes:
    """Agent -> slot, as bytes."""
    return bytes(slot_of) if len(slot_of) <= _ONE_BYTE else struct.pack(f"<{len(slot_of)}H", *slot_of)


def unpack_slots(data: object, agents: int) -> tuple[int, ...]:
    """The assignment of so many agents that `pack_slots` wrote; whether it is a permutation is not looked at.

    Raises:
        ValueError: it is none.
    """
    width = 1 if agents <= _ONE_BYTE else 2
    if not isinstance(data, bytes) or len(data) != width * agents:
        raise ValueError(f"an assignment of {agents} slots has {width * agents} bytes")
    return tuple(data) if width == 1 else struct.unpack(f"<{agents}H", data)


def unpack_all(packed: Sequence[bytes], agents: int) -> NDArray[np.int16]:
    """K assignments of so many agents each that `pack_slots` wrote, (K, N)."""
    rows = np.frombuffer(b"".join(packed), "u1" if agents <= _ONE_BYTE else "<u2")
    return rows.reshape(len(packed), agents).astype(np.int16)
