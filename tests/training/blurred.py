"""A model whose plans are wrong by so much more: ``python -m tests.training.blurred rsc-h1-paper 4.0e-4 blurred.onnx``, for
``rsc-swarm evaluate --mission paper --policy blurred.onnx``.

The error is a sine of what the drone observes, quick enough to be another in every tick, so that flights repeat. Where a model
says an acceleration to be carried out (``output: action``), that is wrong by as much as leads so far astray in a tick.
"""

import argparse
from pathlib import Path

import numpy as np
import onnx
from onnx import helper, numpy_helper

from protocols.dynamics import TICK_S
from rsc_swarm.training.describe import describe

MODELS = Path(__file__).resolve().parents[2] / "agent" / "policy" / "models"
_QUICKNESS = 1e4  # rad for each unit of an observation


def blurred(model: onnx.ModelProto, mean_m: float) -> onnx.ModelProto:
    """``model`` with an error of this mean absolute size [m] on every displacement; all steps of a plan have the same. An
    acceleration that it says by itself, and does not work out of displacements, is off by what makes this error in a tick."""
    graph = model.graph
    (told,) = [node for node in graph.node if "acceleration" in node.output]
    wrong = ["displacement"] if "displacement" in told.input else ["displacement", "acceleration"]
    for node in graph.node:
        node.output[:] = [f"clean {name}" if name in wrong else name for name in node.output]
    mix = _QUICKNESS * np.random.default_rng(0).standard_normal((18, 2))
    for name, value in {
        "newest": np.array(-1),
        "mix": mix.astype(np.float32),
        "size": np.float32(mean_m * np.pi / 2),  # |sin| is 2 / pi on average
        "speeding": np.float32(2 / TICK_S**2),
        "drones": np.array([-1, 1, 2]),
    }.items():
        graph.initializer.append(numpy_helper.from_array(np.asarray(value), name))
    made = [
        helper.make_node("Gather", ["own", "newest"], ["now"], axis=1),
        helper.make_node("MatMul", ["now", "mix"], ["angle"]),
        helper.make_node("Sin", ["angle"], ["sine"]),
        helper.make_node("Mul", ["sine", "size"], ["flat"]),
        helper.make_node("Reshape", ["flat", "drones"], ["error"]),
        helper.make_node("Add", ["clean displacement", "error"], ["displacement"]),
    ]
    after = next(place for place, node in enumerate(graph.node) if "clean displacement" in node.output) + 1
    nodes = [*graph.node[:after], *made, *graph.node[after:]]
    if "acceleration" in wrong:
        nodes.append(helper.make_node("Mul", ["error", "speeding"], ["push"]))
        nodes.append(helper.make_node("Add", ["clean acceleration", "push"], ["acceleration"]))
    del graph.node[:]
    graph.node.extend(nodes)
    kept = {entry.key: entry.value for entry in model.metadata_props if entry.key not in ("network", "heads")}
    helper.set_model_props(model, kept)  # it is no network of ours any more
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
