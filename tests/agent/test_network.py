"""Networks of ours, computed by rules: what ONNX Runtime makes of the same files, but with the same bits on every processor."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from onnx import GraphProto, ModelProto, TensorProto

from agent.policy import network_kernel
from agent.policy.base import PolicyError
from agent.policy.learned import Learned
from agent.policy.learned_kernel import Question, empty_question
from agent.policy.model_file import (
    SHIPPED,
    Model,
    ModelFileError,
    ModelNote,
    note_of,
    read_model,
    shipped_models,
)
from agent.policy.network import Network
from agent.policy.session import Session
from agent.policy.weights import tensors_in
from protocols import machine_code
from protocols.kernels import Kernel
from protocols.mission.document import parse_mission

Plans = tuple[np.ndarray, np.ndarray]
ROWS = 12


def shipped(name: str) -> Model:
    return read_model(SHIPPED / f"{name}.onnx")


def question(note: ModelNote, seed: int = 0) -> Question:
    """Of ``ROWS`` rows that have heard nobody, some or as many as can be."""
    draw = np.random.default_rng(seed)
    asked = empty_question(ROWS, note.past, 0 if note.rounds else note.neighbours, note.rounds)
    for numbers in (asked.own, asked.heard, asked.means, asked.target, asked.extra):
        numbers[:] = draw.normal(size=numbers.shape)
    for row in range(ROWS):
        for tick in range(note.past if not note.rounds else 0):
            heard = draw.integers(0, note.neighbours + 1)
            asked.share[row, tick, :heard] = 1.0 / max(heard, 1)
            asked.heard[row, tick, heard:] = 0.0
    return asked


def planned(
    by: Network | Session, note: ModelNote, asked: Question, first: int = 0, end: int = ROWS
) -> Plans:
    out = np.zeros((ROWS, note.horizon, 2), np.float32), np.zeros((ROWS, note.horizon, 2), np.float32)
    by.plan(first, end, asked, *out)
    return out[0][: end - first], out[1][: end - first]


@pytest.mark.parametrize("name", shipped_models())
def test_it_plans_what_the_file_says(name: str) -> None:
    model = shipped(name)
    note, asked = model.facts, question(model.facts)
    assert note.network == "1"
    ours = planned(Network(note, model.data), note, asked)
    for plan, meant in zip(ours, planned(Session(note, model.data), note, asked), strict=True):
        assert np.abs(plan - meant).max() <= 1e-5 * max(1.0, np.abs(meant).max())
    assert np.abs(ours[0]).max() > 0


@pytest.mark.parametrize("name", ["rsc-h20", "rsc-h20-paper", "stgnn", "stgnn-paper"])
def test_a_rows_plan_depends_neither_on_the_rows_beside_it_nor_on_those_before(name: str) -> None:
    """A drone asks for itself, a simulation for many at once: the bits must be the same, or twins would part."""
    model = shipped(name)
    note, asked = model.facts, question(model.facts)
    network = Network(note, model.data)
    whole = planned(network, note, asked)
    for first in (*reversed(range(ROWS)), 5, 4):
        for some, all_ in zip(planned(network, note, asked, first, first + 1), whole, strict=True):
            assert np.array_equal(some[0], all_[first])
    alone = np.zeros((2, 1, note.horizon, 2), np.float32)
    network.bound(asked, *alone)()
    assert np.array_equal(alone[:, 0], [whole[0][0], whole[1][0]])


@pytest.mark.parametrize("name", ["rsc-h20", "stgnn-paper"])
def test_processors_that_can_do_more_at_once_come_to_the_same_bits(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    model = shipped(name)
    note, asked = model.facts, question(model.facts)
    plans = []
    for wide in (False, machine_code.is_wide()):
        for rule in (network_kernel.plan_rsc, network_kernel.plan_stgnn):
            assert isinstance(rule, Kernel)
            monkeypatch.setattr(rule, "_forms", {})  # so that it is linked anew
        monkeypatch.setattr(machine_code, "is_wide", lambda wide=wide: wide)
        plans.append(planned(Network(note, model.data), note, asked))
    assert np.array_equal(plans[0], plans[1])


def changed(tmp_path: Path, **changes: Any) -> Path:
    """rsc-h1 with a note that says something else."""
    path = tmp_path / "mine.onnx"
    model = shipped("rsc-h1")
    path.write_bytes(model.data)
    note_of(path).write_text(model.facts.model_copy(update=changes).model_dump_json())
    return path


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"horizon": 2, "replan": 1}, "plan.displacement: should be of shape (any, 2), but is of (1, 1)"),
        ({"past": 4}, "network.when: should be of shape (4, 128), but is of (3, 128)"),
        ({"extra": "none"}, "network.normal_local.mean: should be of shape (2), but is of (34)"),
        ({"kind": "stgnn"}, "network.head.0.weight: should be of shape (128, 106), but is of (128, 256)"),
        ({"heads": 3}, "3 heads cannot share 128 numbers"),
    ],
)
def test_a_file_that_holds_another_network_than_its_note_says_is_refused(
    tmp_path: Path, changes: dict[str, Any], said: str
) -> None:
    path = changed(tmp_path, **changes)
    learned = Learned(parse_mission({"agents": 4, "policy": str(path)}), path)
    with pytest.raises(PolicyError) as refused:
        learned.open()
    assert str(refused.value) == f"policy: {path}: cannot be run ({said})"


def test_numbers_that_are_none_are_refused(tmp_path: Path) -> None:
    path = changed(tmp_path)
    data = bytearray(path.read_bytes())
    data[200_000:200_040] = b"\xff" * 40  # among the weights of a layer
    changed(tmp_path, sha256=hashlib.sha256(data).hexdigest())
    path.write_bytes(data)
    with pytest.raises(PolicyError, match="numbers that are not finite"):
        Learned(parse_mission({"agents": 4, "policy": str(path)}), path).open()


@pytest.mark.parametrize("shape", [[0, 2**63], [2**64 - 1], [1] * 70, [0], [3]])
def test_a_tensor_of_a_shape_that_cannot_be_is_refused(shape: list[int]) -> None:
    tensor = TensorProto(name="a", data_type=TensorProto.FLOAT, raw_data=bytes(4))
    data = ModelProto(graph=GraphProto(initializer=[tensor])).SerializeToString()
    assert tensors_in(data)["a"] == 0
    tensor.dims.extend(size if size < 2**63 else size - 2**64 for size in shape)
    with pytest.raises(ModelFileError):
        tensors_in(ModelProto(graph=GraphProto(initializer=[tensor])).SerializeToString())


@pytest.mark.parametrize("size", [1, 100, 5_000, 500_000])
def test_a_file_that_is_cut_off_is_found_out(size: int) -> None:
    with pytest.raises(ModelFileError):
        tensors_in(shipped("rsc-h1").data[:-size])
