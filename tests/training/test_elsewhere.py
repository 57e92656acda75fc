"""The flights of an epoch in parts: the same training, whoever flies them."""

import json
from concurrent.futures import ThreadPoolExecutor

import pytest
import torch

from rsc_swarm.training.dagger import train
from rsc_swarm.training.elsewhere import OtherMachineError, Planner, fly_there
from rsc_swarm.training.flying import Part, fly
from rsc_swarm.training.network import make_network
from rsc_swarm.training.replay import Replay
from rsc_swarm.training.watcher import Nobody
from tests.training.conftest import weights


def test_an_epochs_parts_are_flown_by_others_to_the_same_weights(tiny, tmp_path, unexported):
    config = tiny.model_copy(update={"parts": 2, "dropout": 0.1})
    train(config, tmp_path / "here", "cpu", 1, Nobody())
    with ThreadPoolExecutor(1) as others:
        train(config, tmp_path / "there", "cpu", 1, Nobody(), others)
    for name, here in weights(tmp_path / "here").items():
        assert torch.equal(here, weights(tmp_path / "there")[name]), name
    curves = [
        [json.loads(line) for line in (tmp_path / place / "curve.jsonl").read_text().splitlines()]
        for place in ("here", "there")
    ]
    for here, there in zip(*curves, strict=True):
        times = {"flown_s", "learned_s"}
        assert {name: here[name] for name in here.keys() - times} == {
            name: there[name] for name in there.keys() - times
        }
        assert here["graphs"] % (config.worlds * config.plans) == 0


def test_every_part_has_chance_of_its_own(tiny):
    config = tiny.model_copy(update={"parts": 2})
    flown = []
    for number, worlds in ((0, 2), (1, 1)):
        part = Part(config, 0, number, 1.0)
        replay = Replay(config, torch.device("cpu"), part.graphs)
        fly(part, make_network(config).eval(), replay, lambda: None)
        assert len(replay) == part.graphs == worlds * config.plans
        flown.append(replay.newest(part.graphs).observation)
    assert not torch.equal(flown[0][:1], flown[1][:1])


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        ({"torch": "0.1"}, "has torch .*, not 0.1 as this command: install the same"),
        (
            {"device": "cuda"},
            "has no GPU, as this command does: start workers where one is, or give --device cpu",
        ),
    ],
)
def test_a_worker_that_would_plan_otherwise_flies_nothing(tiny, wrong, complaint):
    planner = Planner({}, torch.__version__, 1, "cpu")._replace(**wrong)
    with pytest.raises(OtherMachineError, match=complaint):
        fly_there(Part(tiny, 0, 0, 1.0), planner)
