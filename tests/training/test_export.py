"""What is exported in half precision flies as the rounded network does, from a file of half the size; and a model that is made
worse by so much is.

In a process of its own: a session of ONNX Runtime is opened, and this one may fork later.
"""

import json
import subprocess
import sys

_EXPORT = """
import json, sys
from pathlib import Path
import numpy as np, onnx, torch
from agent.policy.session import open_session
from rsc_swarm.training.config import make_config
from rsc_swarm.training.export import export, inputs_of
from rsc_swarm.training.network import make_network
from rsc_swarm.batch.model_inputs import ModelInputs
from rsc_swarm.training.describe import describe
from tests.training.blurred import blurred
torch.manual_seed(0)
full = make_config("paper", None, horizon=4, width=64, feedforward=64, float16=False)
network = make_network(full)
with torch.no_grad():
    network.head[-1].weight.normal_()
chance = np.random.default_rng(0)
heard = {name: chance.normal(size=(40, *shape)).astype(np.float32) for name, shape in inputs_of(full).items()}
said = []
for config, name in ((full, "full"), (full.model_copy(update={"float16": True}), "half")):
    path = Path(sys.argv[1]) / f"{name}.onnx"
    export(network, config, ModelInputs(**(dict.fromkeys(ModelInputs._fields) | heard)), path)
    said.append(open_session(path.read_bytes()).run(None, heard)[0])
sizes = [(Path(sys.argv[1]) / f"{name}.onnx").stat().st_size for name in ("full", "half")]
off = float(np.abs(said[0] - said[1]).max() / np.abs(said[0]).max())
worse = blurred(onnx.load(Path(sys.argv[1]) / "full.onnx"), 4e-4).SerializeToString()
worse_m = float(np.abs(open_session(worse).run(None, heard)[0] - said[0]).mean())
print(json.dumps([sizes, off, describe(Path(sys.argv[1]) / "half.onnx").horizon, worse_m]))
"""


def test_a_model_in_half_precision_is_half_as_large_and_plans_nearly_the_same(tmp_path):
    run = subprocess.run(
        [sys.executable, "-c", _EXPORT, str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    (full, half), off, horizon, worse_m = json.loads(run.stdout)
    assert half < 0.7 * full
    assert 0 < off < 1e-2
    assert horizon == 4
    assert 3e-4 < worse_m < 5e-4
