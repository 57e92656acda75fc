"""The experiment that makes a model's plans worse, which docs/paper.md tells of."""

import numpy as np
import onnx
import pytest

from agent.policy.session import open_session
from protocols.dynamics import TICK_S
from tests.training.blurred import MODELS, blurred


@pytest.mark.parametrize(("name", "off_mps2"), [("rsc-h1-paper", 0.0), ("stgnn-paper", 2 * 4e-4 / TICK_S**2)])
def test_what_a_model_says_is_off_by_as_much_in_a_tick(name: str, off_mps2: float) -> None:
    model, chance = onnx.load(MODELS / f"{name}.onnx"), np.random.default_rng(0)
    seen = {
        given.name: chance.normal(size=[each.dim_value or 200 for each in given.type.tensor_type.shape.dim])
        for given in model.graph.input
    }
    asked = {what: numbers.astype(np.float32) for what, numbers in seen.items()}
    names = ["displacement", "acceleration"]
    clean = open_session(model.SerializeToString()).run(names, asked)
    worse = open_session(blurred(model, 4e-4).SerializeToString()).run(names, asked)
    displacement_m, acceleration_mps2 = (np.abs(b - a) for a, b in zip(clean, worse, strict=True))
    assert displacement_m.mean() == pytest.approx(4e-4, rel=0.1)
    assert acceleration_mps2.mean() == pytest.approx(off_mps2, rel=0.1)
