"""A training so small that it takes a second."""

from typing import Any

import pytest
import torch

from rsc_swarm.training import dagger
from rsc_swarm.training.config import TrainingConfig

TINY: dict[str, Any] = {
    "horizon": 4,
    "agents": 4,
    "width": 8,
    "heads": 2,
    "feedforward": 8,
    "hard_share": 0.0,
    "worlds": 3,
    "rounds": 6,
    "epochs": 3,
    "updates": 12,
    "batch": 4,
    "replay": 36,
    "bfloat16": False,
}


@pytest.fixture
def tiny() -> TrainingConfig:
    return TrainingConfig(**TINY)


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    """Tests share their processors with others; torch's threads wait for each other."""
    torch.set_num_threads(1)


@pytest.fixture
def unexported(monkeypatch):
    """No model is written: its check opens a session of ONNX Runtime, and this process may fork later."""
    monkeypatch.setattr(dagger, "export", lambda *_: None)


def weights(folder):
    return torch.load(folder / "checkpoint.pt", weights_only=True)["learner"]["average"]
