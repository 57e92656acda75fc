"""Rows of arrays as the bytes they are made of, for copying to and from the wire, in Python and in kernels."""

import math
import mmap
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from protocols.kernels import inlined_kernel


def room(shape: tuple[int, ...], kind: DTypeLike) -> NDArray[Any]:
    """Zeros that take memory only where they are written to. NumPy's take it all where they come to lie in what was freed."""
    count = math.prod(shape)
    size = max(count * np.dtype(kind).itemsize, 1)
    return np.frombuffer(mmap.mmap(-1, size, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS), kind, count).reshape(
        shape
    )


def bytes_of(array: NDArray[Any]) -> memoryview:
    """The bytes of a contiguous array, to be read and written in place."""
    return as_bytes(array).data


def as_bytes(array: NDArray[Any]) -> NDArray[np.uint8]:
    """The same, as an array for kernels."""
    return array.reshape(-1).view(np.uint8)


@inlined_kernel
def put_number(out: NDArray[np.uint8], at: int, value: int, size: int) -> int:
    """Write a whole number in ``size`` bytes, the lowest first; where the next goes."""
    for place in range(size):
        out[at + place] = (value >> (8 * place)) & 255
    return at + size


@inlined_kernel
def put_bytes(out: NDArray[np.uint8], at: int, data: NDArray[np.uint8], begin: int, size: int) -> int:
    """Write ``size`` bytes of ``data`` from ``begin`` on; where the next go."""
    for place in range(size):
        out[at + place] = data[begin + place]
    return at + size


@inlined_kernel
def get_number(data: NDArray[np.uint8], at: int, size: int) -> int:
    """What `put_number` wrote."""
    value = 0
    for place in range(size):
        value += int(np.int64(data[at + place])) << (8 * place)
    return value
