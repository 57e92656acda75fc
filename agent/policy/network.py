"""A network of our own, ready to plan: its weights out of a model file, and room to work in (agent.policy.network_kernel)."""

from collections.abc import Callable, Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from agent.observation import WIDE_SIZE
from agent.policy.layers import Floats, Layer, Normal
from agent.policy.learned_kernel import Question
from agent.policy.model_file import ModelFileError, ModelNote
from agent.policy.network_kernel import Room, Rsc, Stgnn, plan_rsc, plan_stgnn
from agent.policy.weights import tensors_in
from protocols.kernels import bound, by_reference
from protocols.wire.frames import OBSERVATION_SIZE

Tensors = Mapping[str, NDArray[np.float32]]
_TARGET_SIZE = 2


class Network:
    """What a model file of ours computes, in kernels. It works for one at a time."""

    def __init__(self, note: ModelNote, data: bytes) -> None:
        """Raises ModelFileError if the file holds no such network."""
        net = _read(note, data)
        self._rule: Callable[..., None] = plan_rsc if isinstance(net, Rsc) else plan_stgnn
        self._net, self._room = by_reference(net), by_reference(_room(net, note))
        self._asked: Question | None = None

    def plan(self, first: int, end: int, asked: Question, displacement: Floats, acceleration: Floats) -> None:
        """Answer places ``first`` to ``end`` of what is asked: (A, H, 2) each, from place 0 on."""
        if asked is not self._asked:
            self._asked, self._page = asked, by_reference(asked)
        self._rule(first, end, self._page, self._net, self._room, displacement, acceleration)

    def bound(self, asked: Question, displacement: Floats, acceleration: Floats) -> Callable[[], None]:
        """What answers place 0 of what is asked, (1, H, 2) each, whenever it is called."""
        return bound(self._rule, 0, 1, by_reference(asked), self._net, self._room, displacement, acceleration)


@lru_cache(maxsize=4)
def _read(note: ModelNote, data: bytes) -> Rsc | Stgnn:
    """Read once, the weights are kept: drones forked afterwards share them."""
    weights = _Weights(tensors_in(data))
    return _rsc(weights, note) if note.kind == "rsc" else _stgnn(weights, note)


class _Weights:
    """Tensors of known names and sizes."""

    def __init__(self, tensors: Tensors) -> None:
        self._tensors = tensors

    def get(self, name: str, *shape: int) -> Floats:
        """Of this shape; 0: of any size."""
        tensor = self._tensors.get(name)
        if tensor is None:
            raise ModelFileError(f"it lacks {name}")
        if len(shape) != tensor.ndim or any(
            want not in (0, has) for want, has in zip(shape, tensor.shape, strict=True)
        ):
            raise ModelFileError(
                f"{name}: should be of shape {_told(shape)}, but is of {_told(tensor.shape)}"
            )
        if not np.isfinite(tensor).all():
            raise ModelFileError(f"{name}: holds numbers that are not finite")
        return np.ascontiguousarray(tensor)

    def layer(self, name: str, inputs: int, outputs: int) -> Layer:
        """As torch has it, (out, in), or, where all rows of a product have it in common, the other way around."""
        if f"{name}.weight.T" in self._tensors:
            weight = self.get(f"{name}.weight.T", inputs, outputs)
        else:
            weight = np.ascontiguousarray(self.get(f"{name}.weight", outputs, inputs).T)
        biased = f"{name}.bias" in self._tensors
        return Layer(weight, self.get(f"{name}.bias", outputs) if biased else np.zeros(outputs, np.float32))

    def normal(self, name: str, size: int) -> Normal:
        return Normal(self.get(f"{name}.mean", size), self.get(f"{name}.deviation", size))

    def layer_norm(self, name: str, size: int) -> Normal:
        return Normal(self.get(f"{name}.bias", size), self.get(f"{name}.weight", size))


def _told(shape: tuple[int, ...]) -> str:
    return f"({', '.join(str(size or 'any') for size in shape)})"


def _points(weights: _Weights, horizon: int) -> tuple[Floats, Floats]:
    displacement = weights.get("plan.displacement", 0, horizon)
    return displacement, weights.get("plan.acceleration", len(displacement), horizon)


def _rsc(weights: _Weights, note: ModelNote) -> Rsc:
    own, local = "network.from_own", _local_size(note)
    width = weights.get(f"{own}.bias", 0).shape[0]
    hidden = weights.get("network.time.feedforward.0.bias", 0).shape[0]
    if width % note.heads:
        raise ModelFileError(f"{note.heads} heads cannot share {width} numbers")
    displacement, acceleration = _points(weights, note.horizon)
    square = {
        name: weights.layer(f"network.{layer}", width, width)
        for name, layer in {
            "node_out": "node.2", "from_own": "from_own", "from_neighbours": "from_neighbours", "query": "time.query",
            "key": "time.key", "value": "time.value", "attended": "time.out", "local_out": "local.3",
        }.items()
    }  # fmt: skip
    square["key"] = square["key"]._replace(bias=np.zeros(width, np.float32))  # what all keys have in common
    return Rsc(
        heads=note.heads,
        seen=weights.normal("network.normal_x", OBSERVATION_SIZE),
        target=weights.normal("network.normal_local", local),
        node_in=weights.layer("network.node.0", OBSERVATION_SIZE, width),
        when=weights.get("network.when", note.past, width),
        norm_attended=weights.layer_norm("network.time.after_attention", width),
        forward_in=weights.layer("network.time.feedforward.0", width, hidden),
        forward_out=weights.layer("network.time.feedforward.2", hidden, width),
        norm_forward=weights.layer_norm("network.time.after_feedforward", width),
        local_in=weights.layer("network.local.0", local, width),
        head_in=weights.layer("network.head.0", 2 * width, width),
        head_out=weights.layer("network.head.2", width, 2 * len(displacement)),
        displacement=displacement,
        acceleration=acceleration,
        **square,
    )


def _stgnn(weights: _Weights, note: ModelNote) -> Stgnn:
    local, size = _local_size(note), (1 + note.past) * OBSERVATION_SIZE
    width = weights.get("network.head.0.bias", 0).shape[0]
    displacement, acceleration = _points(weights, note.horizon)
    return Stgnn(
        seen=weights.normal("network.normal_x", OBSERVATION_SIZE),
        target=weights.normal("network.normal_local", local),
        first=weights.layer("network.head.0", size + local, width),
        second=weights.layer("network.head.2", width, width),
        third=weights.layer("network.head.4", width, width),
        last=weights.layer("network.head.6", width, 2 * len(displacement)),
        displacement=displacement,
        acceleration=acceleration,
    )


def _local_size(note: ModelNote) -> int:
    return _TARGET_SIZE + (WIDE_SIZE if note.extra == "wide" else 0)


def _room(net: Rsc | Stgnn, note: ModelNote) -> Room:
    rows, ticks, local = note.past * (1 + max(note.neighbours, 1)), note.past, _local_size(note)
    if isinstance(net, Rsc):
        width, wide = net.from_own.bias.shape[0], net.forward_in.bias.shape[0]
        node, both = width, 2 * width
    else:
        width = wide = net.first.bias.shape[0]
        node, both = OBSERVATION_SIZE, (1 + ticks) * OBSERVATION_SIZE + local

    def floats(rows: int, columns: int) -> Floats:
        return np.zeros((rows, columns), np.float32)

    return Room(
        x=floats(rows, OBSERVATION_SIZE),
        tick=np.zeros(rows, np.int64),
        share=np.zeros(rows, np.float32),
        hidden=floats(rows, width),
        node=floats(rows, width),
        own=floats(ticks, node),
        mean=floats(ticks, node),
        step=floats(ticks, width),
        since=floats(ticks, width),
        key=floats(ticks, width),
        value=floats(ticks, width),
        query=floats(1, width),
        context=floats(1, width),
        forward=floats(1, wide),
        local=floats(1, local),
        local_hidden=floats(1, width),
        both=floats(1, both),
        points=floats(1, 2 * len(net.displacement)),
    )
