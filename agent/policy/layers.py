"""The layers that networks of ours are made of (agent.policy.network_kernel), as rules.

Each sum goes over the inputs in their order, whatever the processor; the loops over outputs are what it may do several of at
once.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.kernels import inlined_kernel, kernel

Floats = NDArray[np.float32]

ZERO = np.float32(0.0)
_CLIP = np.float32(6.0)
_NORM_EPS = 1e-5


class Layer(NamedTuple):
    """y = x ``weight`` + ``bias``: (in, out) and (out,)."""

    weight: Floats
    bias: Floats


class Normal(NamedTuple):
    """What inputs are usually like, (F,) each."""

    mean: Floats
    deviation: Floats


@kernel
def dense(x: Floats, rows: int, layer: Layer, out: Floats) -> None:
    """``out[:rows, :outputs]`` of ``x[:rows]``. Two rows at a time: then weights are fetched half as often. Not
    inlined: there would be a dozen copies of it."""
    for row in range(0, rows - 1, 2):
        _two_rows(x, row, layer, out)
    if rows % 2:
        _row(x, rows - 1, layer, out)


@inlined_kernel
def _row(x: Floats, row: int, layer: Layer, out: Floats) -> None:
    weight, bias = layer.weight, layer.bias
    inputs, outputs = weight.shape
    for j in range(outputs):
        out[row, j] = bias[j]
    whole = inputs - inputs % 4
    for i in range(0, whole, 4):
        a, b, c, d = x[row, i], x[row, i + 1], x[row, i + 2], x[row, i + 3]
        for j in range(outputs):
            total = out[row, j] + a * weight[i, j] + b * weight[i + 1, j]
            out[row, j] = total + c * weight[i + 2, j] + d * weight[i + 3, j]
    for i in range(whole, inputs):
        a = x[row, i]
        for j in range(outputs):
            out[row, j] += a * weight[i, j]


@inlined_kernel
def _two_rows(x: Floats, row: int, layer: Layer, out: Floats) -> None:
    """As `_row`, of ``row`` and the next."""
    weight, bias = layer.weight, layer.bias
    inputs, outputs = weight.shape
    for j in range(outputs):
        out[row, j] = out[row + 1, j] = bias[j]
    whole = inputs - inputs % 4
    for i in range(0, whole, 4):
        a, b, c, d = x[row, i], x[row, i + 1], x[row, i + 2], x[row, i + 3]
        e, f, g, h = x[row + 1, i], x[row + 1, i + 1], x[row + 1, i + 2], x[row + 1, i + 3]
        for j in range(outputs):
            p, q, r, s = weight[i, j], weight[i + 1, j], weight[i + 2, j], weight[i + 3, j]
            out[row, j] = out[row, j] + a * p + b * q + c * r + d * s
            out[row + 1, j] = out[row + 1, j] + e * p + f * q + g * r + h * s
    for i in range(whole, inputs):
        a, e = x[row, i], x[row + 1, i]
        for j in range(outputs):
            out[row, j] += a * weight[i, j]
            out[row + 1, j] += e * weight[i, j]


@kernel
def rectify(out: Floats, rows: int, columns: int, slope: np.float32) -> None:
    """Negative numbers among ``out[:rows, :columns]``, times ``slope``."""
    for row in range(rows):
        for j in range(columns):
            value = out[row, j]
            out[row, j] = value if value > ZERO else slope * value


@inlined_kernel
def z_score(value: np.float32, normal: Normal, index: int) -> np.float32:
    """The z-score of an input, clipped."""
    score = (value - normal.mean[index]) / normal.deviation[index]
    return min(max(score, -_CLIP), _CLIP)


@kernel
def layer_norm(x: Floats, normal: Normal) -> None:
    """Bring ``x[0]`` to a mean of 0 and a variance of 1, then to ``normal``."""
    size, total, squares = normal.mean.shape[0], 0.0, 0.0
    for j in range(size):
        total += np.float64(x[0, j])
    mean = total / size
    for j in range(size):
        off = np.float64(x[0, j]) - mean
        squares += off * off
    factor = 1.0 / math.sqrt(squares / size + _NORM_EPS)
    for j in range(size):
        x[0, j] = np.float32((np.float64(x[0, j]) - mean) * factor) * normal.deviation[j] + normal.mean[j]
