"""The tensors in a model file, by name: as much of ONNX as that takes, without the libraries that make such files.

ONNX is protobuf: a message is fields, each a number, a kind and a value (protobuf.dev/programming-guides/encoding). The graph is
field 7 of a model, a tensor field 5 of a graph (onnx/onnx.proto).
"""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from agent.policy.model_file import ModelFileError

_GRAPH, _TENSOR = 7, 5
_DIMS, _KIND, _NAME, _RAW = 1, 2, 8, 9
_MOST_AXES = 8
_DTYPES = {1: np.float32, 10: np.float16}
_HALF = ".half"  # what is kept in half precision is named so (rsc_swarm.training.export)


def tensors_in(data: bytes) -> dict[str, NDArray[np.float32]]:
    """All tensors of floating point numbers that a model file holds.

    Raises:
        ModelFileError: it is damaged.
    """
    found: dict[str, NDArray[np.float32]] = {}
    for number, graph in _fields(data):
        if number == _GRAPH and isinstance(graph, bytes):
            for part, tensor in _fields(graph):
                if part == _TENSOR and isinstance(tensor, bytes):
                    found.update(_tensor(tensor))
    return found


def _tensor(data: bytes) -> Iterator[tuple[str, NDArray[np.float32]]]:
    shape: list[int] = []
    kind, name, raw = 0, b"", b""
    for number, value in _fields(data):
        if number == _DIMS:
            shape += [value] if isinstance(value, int) else _numbers(value)
        elif number == _KIND and isinstance(value, int):
            kind = value
        elif number == _NAME and isinstance(value, bytes):
            name = value
        elif number == _RAW and isinstance(value, bytes):
            raw = value
    if kind not in _DTYPES:
        return
    dtype = np.dtype(_DTYPES[kind]).newbyteorder("<")
    if len(shape) > _MOST_AXES or not raw or len(raw) != math.prod(shape) * dtype.itemsize:
        raise ModelFileError(f"a tensor of {shape} numbers has {len(raw)} bytes")
    yield (
        name.decode(errors="replace").removesuffix(_HALF),
        np.frombuffer(raw, dtype).astype(np.float32).reshape(shape),
    )


def _fields(data: bytes) -> Iterator[tuple[int, int | bytes]]:
    """Number and value of each field."""
    at = 0
    while at < len(data):
        key, at = _number(data, at)
        kind = key & 7
        if kind == 0:
            value, at = _number(data, at)
            yield key >> 3, value
            continue
        if kind == 2:
            size, at = _number(data, at)
        elif kind in (1, 5):
            size = 8 if kind == 1 else 4
        else:
            raise ModelFileError(f"a field of kind {kind}")
        if at + size > len(data):
            raise ModelFileError("it is cut off")
        yield key >> 3, data[at : at + size]
        at += size


def _numbers(data: bytes) -> list[int]:
    found, at = [], 0
    while at < len(data):
        value, at = _number(data, at)
        found.append(value)
    return found


def _number(data: bytes, at: int) -> tuple[int, int]:
    """A number of seven bits a byte, the lowest first, and where it ends."""
    value = 0
    for shift in range(0, 64, 7):
        if at >= len(data):
            raise ModelFileError("it is cut off")
        byte = data[at]
        value |= (byte & 127) << shift
        at += 1
        if byte < 128:
            return value, at
    raise ModelFileError("a number without an end")
