"""A trained network as a model file, checked against torch, and its note with everything a drone must know about it."""

import copy
import warnings
from pathlib import Path

import numpy as np
import onnx
import torch
from torch import Tensor, nn

from agent.observation import WIDE_SIZE
from agent.policy.model_file import FORMAT, note_of
from agent.policy.session import open_session
from protocols.whole_file import write_whole
from protocols.wire.frames import OBSERVATION_SIZE
from rsc_swarm.batch.batch import NEIGHBOURS
from rsc_swarm.batch.model_inputs import ModelInputs
from rsc_swarm.flight.provenance import commit
from rsc_swarm.machine.leaving import passing_folder
from rsc_swarm.training.config import TrainingConfig, TrainingError
from rsc_swarm.training.describe import describe
from rsc_swarm.training.network import PolicyNetwork

OPSET = 17
VERSION, FEATURES, NETWORK = "1", "1", "1"
TOLERANCE = 1e-5
_MANY = 1024  # numbers in a tensor, from which on halving it is worth a node in the file


class ModelFile(nn.Module):
    """The network with the inputs and outputs of the model file."""

    def __init__(self, network: PolicyNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, own: Tensor, *others: Tensor) -> tuple[Tensor, Tensor]:
        """Displacement and acceleration, (B, H, 2) each, from the inputs in the order of `inputs_of`."""
        said = 1 if self.network.hops else 2
        local = torch.cat(others[said:], -1)
        displacement, _, acceleration = self.network.plan(self.network.drones(own, others[:said], local))
        return displacement, acceleration


def inputs_of(config: TrainingConfig) -> dict[str, tuple[int, ...]]:
    """The inputs of the model file by name, in order, and their shapes for one drone."""
    past = config.past
    said = {"heard": (past, NEIGHBOURS, OBSERVATION_SIZE), "share": (past, NEIGHBOURS)}
    if config.aggregation == "hops":
        said = {"means": (past, OBSERVATION_SIZE)}
    extra = {"extra": (WIDE_SIZE,)} if config.extra == "wide" else {}
    return {"own": (past, OBSERVATION_SIZE), **said, "target": (2,), **extra}


def export(network: PolicyNetwork, config: TrainingConfig, recorded: ModelInputs, path: Path) -> float:
    """Write the model file and its note; return its largest difference from torch on the recorded observations.

    Raises:
        TrainingError: the file's outputs differ from torch's by more than 1e-5, or that share of the largest where it is above 1.
    """
    model = ModelFile(rounded(network) if config.float16 else network).eval()
    names = list(inputs_of(config))
    example = tuple(torch.zeros(2, *shape) for shape in inputs_of(config).values())
    outputs = ["displacement", "acceleration"]
    with passing_folder() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the newer exporter needs one more package and gains nothing here
        exported = folder / "exported.onnx"
        torch.onnx.export(
            model.cpu(),
            example,
            exported,
            input_names=names,
            output_names=outputs,
            dynamic_axes={name: {0: "drones"} for name in names + outputs},
            opset_version=OPSET,
            dynamo=False,
        )
        document = onnx.load(exported)
    for output in document.graph.output:  # the exporter cannot tell all their sizes
        _, steps, axes = output.type.tensor_type.shape.dim
        steps.dim_value, axes.dim_value = config.horizon, 2
    name_weights(document, model.network)
    if config.float16:
        halve(document)
    onnx.helper.set_model_props(document, metadata(config))
    onnx.checker.check_model(document)
    data = document.SerializeToString()
    difference = _difference(data, model, recorded, names)
    if difference > TOLERANCE:
        raise TrainingError(
            f"{path}: the exported model differs from torch by {difference:.1e}; at most 1e-5"
        )
    note_of(path).unlink(missing_ok=True)  # it belongs to what was here before
    write_whole(path, data)
    describe(path)
    return difference


def rounded(network: PolicyNetwork) -> PolicyNetwork:
    """A copy of which every large tensor of weights is exact in half precision."""
    network = copy.deepcopy(network)
    with torch.no_grad():
        for weights in network.parameters():
            if weights.numel() >= _MANY:
                weights.copy_(weights.half())
    return network


def name_weights(document: onnx.ModelProto, network: PolicyNetwork) -> None:
    """Give every tensor the name by which agent.policy.network knows it: torch's, but for those that the exporter has turned.
    What the numbers of a plan mean is there as ``plan.displacement`` and ``plan.acceleration``, (M, H) each."""
    renamed = {}
    for node in list(document.graph.node):
        if node.op_type == "Identity" and node.output[0].startswith("network."):
            document.graph.node.remove(node)  # of two tensors that are equal the exporter has kept one
        weight = node.input[1] if node.op_type == "MatMul" else ""
        if weight.startswith("onnx::"):
            renamed[weight] = f"network.{_layer(node.name)}.weight.T"
    for node in document.graph.node:
        node.input[:] = [renamed.get(name, name) for name in node.input]
    for tensor in document.graph.initializer:
        tensor.name = renamed.get(tensor.name, tensor.name)
    plan, there = network.plan, {tensor.name.removesuffix(".T") for tensor in document.graph.initializer}
    displacement, _, acceleration = plan(
        torch.eye(plan.size)[: plan.points]
    )  # of each point of the first axis
    means = {"plan.displacement": displacement[..., 0], "plan.acceleration": acceleration[..., 0]}
    weights = {f"network.{name}": value for name, value in network.state_dict().items()}
    for name, value in (means | weights).items():
        if name not in there:
            document.graph.initializer.append(
                onnx.numpy_helper.from_array(value.detach().cpu().numpy(), name)
            )


def _layer(node: str) -> str:
    """Torch's name of the layer that a node is of: ``/time/feedforward/feedforward.0/MatMul`` is of ``time.feedforward.0``."""
    names: list[str] = []
    for part in node.split("/")[1:-1]:
        if names and part.startswith(f"{names[-1]}."):
            names.pop()
        names.append(part)
    return ".".join(names)


def halve(document: onnx.ModelProto) -> None:
    """Keep large tensors that are exact in half precision as such: it flies as before, from a file of half the size.

    They are cast back when the model is opened.
    """
    for place, tensor in enumerate(document.graph.initializer):
        values = onnx.numpy_helper.to_array(tensor)
        half = values.astype(np.float16)
        if values.dtype != np.float32 or values.size < _MANY or not np.array_equal(half, values):
            continue
        name, kept = tensor.name, f"{tensor.name}.half"
        cast = onnx.helper.make_node("Cast", [kept], [name], to=onnx.TensorProto.FLOAT)
        document.graph.initializer[place].CopyFrom(onnx.numpy_helper.from_array(half, kept))
        document.graph.node.insert(0, cast)


def metadata(config: TrainingConfig) -> dict[str, str]:
    """What a drone must know to fly the model, and where it came from."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "features": FEATURES,
        "kind": config.kind,
        "horizon": str(config.horizon),
        "past": str(config.past),
        "neighbours": str(NEIGHBOURS),
        "aggregation": config.aggregation,
        "extra": config.extra,
        "output": config.output,
        "replan": str(config.replan),
        "network": NETWORK,
        "heads": str(config.heads),
        "config": config.model_dump_json(),
        "seed": str(config.seed),
        "commit": commit() or "unknown",
    }


def _difference(data: bytes, model: ModelFile, recorded: ModelInputs, names: list[str]) -> float:
    inputs = {name: getattr(recorded, name) for name in names}
    said = open_session(data).run(None, inputs)
    with torch.no_grad():
        meant = model(*(torch.from_numpy(value) for value in inputs.values()))
    # Accelerations reach 10 m/s²: single precision cannot hold them to 1e-5 m/s², but to that share of the largest.
    return max(
        float(np.abs(a - b.numpy()).max()) / max(1.0, float(b.abs().max()))
        for a, b in zip(said, meant, strict=True)
    )
