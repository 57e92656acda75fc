"""Rows of arrays as the bytes they are made of, for copying to and from the wire."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def bytes_of(array: NDArray[Any]) -> memoryview:
    """The bytes of a contiguous array, to be read and written in place."""
    return array.reshape(-1).view(np.uint8).data
