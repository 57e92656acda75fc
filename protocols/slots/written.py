"""An assignment of slots as bytes: one for each drone where that is enough, else two, the lower first."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_ONE_BYTE = 256  # drones, at most


def _width(agents: int) -> str:
    """What is written of each of so many, as NumPy names it."""
    return "u1" if agents <= _ONE_BYTE else "<u2"


def pack_slots(slot_of: Sequence[int]) -> bytes:
    """Agent -> slot, as bytes."""
    return np.asarray(slot_of).astype(_width(len(slot_of))).tobytes()


def unpack_slots(data: object, agents: int) -> NDArray[np.uint16]:
    """The assignment (N,) of so many agents that `pack_slots` wrote; whether it is a permutation is not looked at.

    Raises:
        ValueError: it is none.
    """
    width = np.dtype(_width(agents)).itemsize
    if not isinstance(data, bytes) or len(data) != width * agents:
        raise ValueError(f"an assignment of {agents} slots has {width * agents} bytes")
    return np.frombuffer(data, _width(agents)).astype(np.uint16)


def unpack_all(packed: Sequence[bytes], agents: int) -> NDArray[np.int16]:
    """K assignments of so many agents each that `pack_slots` wrote, (K, N)."""
    rows = np.frombuffer(b"".join(packed), _width(agents))
    return rows.reshape(len(packed), agents).astype(np.int16)
