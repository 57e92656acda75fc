"""A model whose plans are wrong by so much more: ``python -m tests.training.blurred rsc-h1-paper 4.0e-4 blurred.onnx``, for
``rsc-swarm evaluate --mission paper --policy blurred.onnx``.

The error is a sine of what the drone observes, quick enough to be another in every tick, so that flights repeat.
"""

import argparse
from pathlib import Path

import numpy as np
import onnx
from onnx import helper, numpy_helper

from rsc_swarm.training.describe import describe

MODELS = Path(__file__).resolve().parents[2] / "agent" / "policy" / "models"
_QUICKNESS = 1e4  # rad for each unit of an observation


def blurred(model: onnx.ModelProto, mean_m: float) -> onnx.ModelProto:
    """``model`` with an error of this mean absolute size [m] on every displacement; all steps of a plan have the same."""
    graph = model.graph
    for node in graph.node:
        node.output[:] = ["clean" if name == "displacement" else name for name in node.output]
    mix = _QUICKNESS * np.random.default_rng(0).standard_normal((18, 2))
    for name, value in {
        "newest": np.array(-1),
        "mix": mix.astype(np.float32),
        "size": np.float32(mean_m * np.pi / 2),  # |sin| is 2 / pi on average
        "drones": np.array([-1, 1, 2]),
    }.items():
        graph.initializer.append(numpy_helper.from_array(np.asarray(value), name))
    made = [
        helper.make_node("Gather", ["own", "newest"], ["now"], axis=1),
        helper.make_node("MatMul", ["now", "mix"], ["angle"]),
        helper.make_node("Sin", ["angle"], ["sine"]),
        helper.make_node("Mul", ["sine", "size"], ["flat"]),
        helper.make_node("Reshape", ["flat", "drones"], ["error"]),
        helper.make_node("Add", ["clean", "error"], ["displacement"]),
    ]
    after = next(place for place, node in enumerate(graph.node) if "clean" in node.output) + 1
    nodes = [*graph.node[:after], *made, *graph.node[after:]]
    del graph.node[:]
    graph.node.extend(nodes)
    onnx.checker.check_model(model)
    return model


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("model", help="of those that come with the project")
    parser.add_argument("mean_m", type=float, help="of the error's absolute value on each axis")
    parser.add_argument("out", type=Path)
    given = parser.parse_args()
    onnx.save(blurred(onnx.load(MODELS / f"{given.model}.onnx"), given.mean_m), given.out)
    describe(given.out)
    print(f"{given.out}: {given.model}, {given.mean_m:g} m off")


if __name__ == "__main__":
    main()
