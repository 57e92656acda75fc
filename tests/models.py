"""Model files for tests: one of the shape the project ships, with random weights, and any small one written as text."""

from pathlib import Path

import numpy as np
from onnx import ModelProto, TensorProto, helper, numpy_helper, parser

from agent.observation import WIDE_SIZE
from rsc_swarm.training.describe import describe

PAST, NEIGHBOURS, SIZE = 3, 8, 18


def metadata(horizon: int, /, **changes: str) -> dict[str, str]:
    """What a model file says of itself."""
    fields = {
        "format": "rsc-swarm-policy",
        "version": "1",
        "kind": "rsc",
        "horizon": str(horizon),
        "past": str(PAST),
        "neighbours": str(NEIGHBOURS),
        "extra": "none",
        "output": "knots",
        "features": "1",
        "replan": str(horizon),
        "config": "{}",
        "seed": "0",
        "commit": "none",
    }
    return {**fields, **changes}


def written(path: Path, horizon: int, body: str, /, **changes: str) -> Path:
    """Save a model whose nodes are given in ONNX's own text form, e.g. ``displacement = Identity(plan)``."""
    said = f"float[B, {PAST}, {NEIGHBOURS}, {SIZE}] heard, float[B, {PAST}, {NEIGHBOURS}] share"
    if changes.get("aggregation") == "hops":
        said = f"float[B, {PAST}, {SIZE}] means"
    text = f"""
    <ir_version: 8, opset_import: ["" : 17]>
    policy (
        float[B, {PAST}, {SIZE}] own, {said}, float[B, 2] target
    ) => (float[B, {horizon}, 2] displacement, float[B, {horizon}, 2] acceleration) {{
        {body}
    }}"""
    model = parser.parse_model(text)
    helper.set_model_props(model, metadata(horizon, **changes))
    return saved(path, model)


def saved(path: Path, model: ModelProto) -> Path:
    """Save a model with its note."""
    path.write_bytes(model.SerializeToString())
    describe(path)
    return path


def straight_on(horizon: int, acceleration: tuple[float, float] = (0.0, 0.0), told: bool = True) -> str:
    """The body of a model that always plans the same acceleration; if not ``told``, only the way it leads."""
    way = [f"{0.5e-4 * (h + 1) ** 2 * a}" for h in range(horizon) for a in acceleration]
    push = [f"{a if told else 0.0}" for _ in range(horizon) for a in acceleration]
    return f"""
        none = Constant <value_float = 0.0> ()
        middle = Constant <value_ints = [1]> ()
        ahead = Unsqueeze (target, middle)
        still = Mul (ahead, none)
        way = Constant <value = float[1, {horizon}, 2] {{ {", ".join(way)} }}> ()
        push = Constant <value = float[1, {horizon}, 2] {{ {", ".join(push)} }}> ()
        displacement = Add (way, still)
        acceleration = Add (push, still)
    """


class _Graph:
    """Nodes and random weights, written one after the other."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng(seed)
        self.nodes: list[object] = []
        self.weights: list[TensorProto] = []

    def constant(self, value: np.ndarray) -> str:
        self.weights.append(numpy_helper.from_array(value, f"c{len(self.weights)}"))
        return f"c{len(self.weights) - 1}"

    def op(self, kind: str, *inputs: str, out: str | None = None, **attributes: object) -> str:
        out = out or f"n{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, list(inputs), [out], **attributes))
        return out

    def linear(self, x: str, size: int, width: int, out: str | None = None) -> str:
        weight = self._random.normal(size=(size, width)).astype(np.float32) / np.sqrt(size)
        bias = 0.1 * self._random.normal(size=width)
        product = self.op("MatMul", x, self.constant(weight.astype(np.float32)))
        return self.op("Add", product, self.constant(bias.astype(np.float32)), out=out)

    def mlp(self, x: str, size: int, width: int) -> str:
        hidden = self.op("LeakyRelu", self.linear(x, size, width), alpha=0.01)
        return self.op("LeakyRelu", self.linear(hidden, width, width), alpha=0.01)

    def norm(self, x: str, width: int) -> str:
        ones, zeros = np.ones(width, np.float32), np.zeros(width, np.float32)
        return self.op("LayerNormalization", x, self.constant(ones), self.constant(zeros), axis=-1)

    def shaped(self, x: str, *shape: int) -> str:
        return self.op("Reshape", x, self.constant(np.array(shape, np.int64)))


def random_model(horizon: int, width: int, seed: int = 0, wide: bool = False, **changes: str) -> ModelProto:
    """The shape of a real model: embedding, GraphSAGE, transformer, a second stream for the target, and a head."""
    g, heads = _Graph(seed), 4
    own = g.mlp("own", SIZE, width)
    heard = g.mlp("heard", SIZE, width)
    share = g.op("Unsqueeze", "share", g.constant(np.array([2], np.int64)))  # (B, L, 1, K)
    mean = g.shaped(g.op("MatMul", share, heard), -1, PAST, width)
    x = g.op("Relu", g.linear(g.op("Concat", own, mean, axis=2), 2 * width, width))
    parts = []
    for _ in range(3):
        part = g.shaped(g.linear(x, width, width), -1, PAST, heads, width // heads)
        parts.append(g.op("Transpose", part, perm=[0, 2, 1, 3]))
    scores = g.op("MatMul", parts[0], g.op("Transpose", parts[1], perm=[0, 1, 3, 2]))
    scale = g.constant(np.array((width / heads) ** -0.5, np.float32))
    weights = g.op("Softmax", g.op("Mul", scores, scale), axis=-1)
    mixed = g.shaped(g.op("Transpose", g.op("MatMul", weights, parts[2]), perm=[0, 2, 1, 3]), -1, PAST, width)
    x = g.norm(g.op("Add", x, g.linear(mixed, width, width)), width)
    x = g.norm(g.op("Add", x, g.linear(g.op("Relu", g.linear(x, width, 256)), 256, width)), width)
    last = g.op("Gather", x, g.constant(np.array(PAST - 1, np.int64)), axis=1)
    aside = g.op("Concat", "target", "extra", axis=1) if wide else "target"
    second = g.mlp(aside, 2 + WIDE_SIZE if wide else 2, width)
    hidden = g.op("Relu", g.linear(g.op("Concat", last, second, axis=1), 2 * width, width))
    rough = g.shaped(g.linear(hidden, width, 2 * horizon), -1, horizon, 2)
    # Accelerations of some m/s^2, and the displacements they lead to.
    acceleration = g.op("Mul", rough, g.constant(np.array(2.0, np.float32)), out="acceleration")
    steps = np.tril(np.ones((horizon, horizon)))
    integral = (0.01**2 * (steps @ steps - 0.5 * steps)).astype(np.float32)
    g.op("MatMul", g.constant(integral), acceleration, out="displacement")

    def tensor(name: str, *shape: object) -> object:
        return helper.make_tensor_value_info(name, TensorProto.FLOAT, ["B", *shape])

    inputs = [
        tensor("own", PAST, SIZE),
        tensor("heard", PAST, NEIGHBOURS, SIZE),
        tensor("share", PAST, NEIGHBOURS),
        tensor("target", 2),
        *([tensor("extra", WIDE_SIZE)] if wide else []),
    ]
    outputs = [tensor("displacement", horizon, 2), tensor("acceleration", horizon, 2)]
    graph = helper.make_graph(g.nodes, "policy", inputs, outputs, g.weights)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    helper.set_model_props(model, metadata(horizon, extra="wide" if wide else "none", **changes))
    return model
