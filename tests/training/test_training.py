"""Training: it learns, a stop costs nothing, and what comes out is a model file that does what the network does."""

import json
import subprocess
import sys

import numpy as np
import pytest
import torch
import yaml
from typer.testing import CliRunner

from agent.observation import WIDE_SIZE
from rsc_swarm.cli import main as cli
from rsc_swarm.cli.train import app  # knows the command, then
from rsc_swarm.training import dagger
from rsc_swarm.training.config import TrainingConfig, make_config
from rsc_swarm.training.dagger import mixing, on_plateau, train
from rsc_swarm.training.flying import training_mission
from rsc_swarm.training.learning import Learner, penalty
from rsc_swarm.training.network import make_network
from rsc_swarm.training.replay import Replay, Samples, mirrored
from rsc_swarm.training.watcher import Nobody
from tests.training.conftest import TINY, weights


class Stopping(Nobody):
    """Presses Ctrl-C when so much of the second epoch is done; knows what of it is kept."""

    def __init__(self, share):
        self.share, self.saved = share, []

    def begin(self, config, curve):
        self.done = len(curve)

    def kept(self, updates):
        self.saved.append(updates)

    def epoch(self, scalars):
        self.done += 1
        self.saved = []

    def step(self, share):
        if self.done == 1 and share > self.share:
            raise KeyboardInterrupt


def test_the_loss_falls(tiny):
    torch.manual_seed(0)
    config = tiny.model_copy(update={"updates": 60, "learning_rate": 1e-2})
    learner, replay = Learner(config, make_network(config)), Replay(config, torch.device("cpu"))
    local = torch.randn(36, 4, 2 + WIDE_SIZE)
    change = 0.05 * local[:, :, None, :2] * torch.arange(1, 5)[:, None]
    replay.add(Samples(torch.randn(36, 4, 4, 18), torch.zeros(36, 3, 4, 8), local, change))
    losses = [learner.learn(replay, lambda *_: None).loss for _ in range(3)]
    assert losses[0] > losses[1] > losses[2]
    assert losses[2] < 0.75 * losses[0]


def test_a_wild_state_counts_by_its_error_and_not_by_the_square():
    assert penalty(torch.tensor([0.1, -0.3]), 0.5) == pytest.approx((0.01 + 0.09) / 2)
    assert penalty(torch.tensor([-10.0]), 0.5) == pytest.approx(2 * 0.5 * 10 - 0.25)
    assert penalty(torch.tensor([-10.0]), None) == pytest.approx(100)


@pytest.mark.parametrize(
    "kind", [{}, {"kind": "stgnn", "output": "action", "horizon": 1}], ids=["rsc", "stgnn"]
)
def test_an_update_mixes_no_devices(tiny, kind):
    """There is no GPU here: tensors without data, which know their shape and their device, stand in for one."""
    gpu = torch.device("meta")
    config = TrainingConfig(**{**tiny.model_dump(exclude_defaults=True), **kind})
    network, replay = make_network(config).to(gpu), Replay(config, gpu)
    recorded = torch.randn(9, 4, 4, 18), torch.zeros(9, 3, 4, 8), torch.randn(9, 4, 2 + WIDE_SIZE)
    replay.add(Samples(*recorded, torch.randn(9, 4, config.horizon, 2)))
    samples = mirrored(replay.take(torch.randint(9, (5,))), torch.ones(5, dtype=torch.bool, device=gpu))
    planned, change, _ = network.plan(network.graphs(*samples[:3]))
    penalty(planned - network.plan.travelled(samples.change) + change, config.outlier_mps2).backward()
    assert all(weight.grad.device == gpu for weight in network.parameters())


def test_the_expert_flies_less_and_less(tiny):
    config = tiny.model_copy(update={"epochs": 20, "mixing_share": 0.2})
    assert [round(mixing(config, epoch), 3) for epoch in (0, 2, 4, 19)] == [1.0, 0.55, 0.1, 0.1]


@pytest.mark.parametrize(
    ("replay", "share", "saved"),
    [(18, 0.7, [0]), (36, 0.2, []), (54, 0.9, list(range(12)))],
    ids=["amid learning", "amid flying", "saved at every update"],
)
def test_a_stopped_training_goes_on_to_the_same_weights(
    tiny, tmp_path, unexported, monkeypatch, replay, share, saved
):
    config = tiny.model_copy(update={"replay": replay, "dropout": 0.1, "validation_maps": 1})
    train(config, tmp_path / "whole", "cpu", 1, Nobody())
    if len(saved) > 1:
        monkeypatch.setattr(dagger, "_SAVE_EVERY_S", 0.0)
    stopping = Stopping(share)
    with pytest.raises(KeyboardInterrupt):
        train(config, tmp_path / "stopped", "cpu", 1, stopping)
    assert stopping.saved == saved
    assert len((tmp_path / "stopped" / "curve.jsonl").read_text().splitlines()) == 1
    train(config, tmp_path / "stopped", "cpu", 1, Nobody())
    for name, whole in weights(tmp_path / "whole").items():
        assert torch.equal(whole, weights(tmp_path / "stopped")[name]), name
    curve = [json.loads(line) for line in (tmp_path / "stopped" / "curve.jsonl").read_text().splitlines()]
    assert [point["epoch"] for point in curve] == [0, 1, 2]
    assert curve[-1]["updates"] == 36
    assert curve[-1]["flown_mae_m"] > 0


def test_the_papers_expert_flies_less_and_less_by_the_episodes_there_were():
    config = make_config("paper", None)
    assert [round(mixing(config, 0, n), 3) for n in (0, 1000, 1001, 1100, 1230, 4000)] == [
        1,
        1,
        0.99,
        0.366,
        0.1,
        0.1,
    ]


def test_the_paper_is_flown_and_labelled_as_the_paper_says():
    config = make_config("paper", None)
    rng = np.random.default_rng(0)
    missions = [training_mission(config, rng, detour=False) for _ in range(50)]
    assert {mission.map_seed for mission in missions} <= set(range(1_000_000, 1_000_500))
    one = missions[0]
    assert (one.aim, one.safety_filter, one.detour, one.sensing.obstacle_memory) == (
        "chain",
        False,
        False,
        False,
    )
    assert (one.swap.rule, one.swap.protocol, one.swap.connected, one.swap.cooldown_s) == (
        "tree", "highest-version", True, 1.0
    )  # fmt: skip
    assert (one.trajectory.tracking, one.trajectory.blend_with) == ("required", "paper")
    assert (config.fly_ticks, config.plans, config.averaging, config.mirror, config.clip) == (
        (20, 20), 105, 0, False, 1.0
    )  # fmt: skip


def test_a_plateau_is_a_last_fifth_that_made_it_less_than_one_percent_better():
    config = make_config("paper", None)

    def curve(*errors: float, mixing: float = 0.1) -> list[dict[str, float]]:
        return [{"validation_mae_m": error, "mixing": mixing} for error in errors]

    falling = [1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3]
    assert on_plateau(config, curve(*falling, 0.299, 0.298))
    assert not on_plateau(config, curve(*falling, 0.29, 0.31))
    assert not on_plateau(config, curve(*falling[:7], 0.4, 0.4)), "too short to tell"
    assert not on_plateau(config, curve(*falling, 0.3, 0.3, mixing=1.0)), "the policy does not fly yet"


def test_another_seed_gives_other_weights(tiny, tmp_path, unexported):
    short = tiny.model_copy(update={"epochs": 1})
    for seed in (0, 1):
        train(short.model_copy(update={"seed": seed}), tmp_path / str(seed), "cpu", 1, Nobody())
    first, second = (weights(tmp_path / str(seed))["module.node.0.weight"] for seed in (0, 1))
    assert not torch.equal(first, second)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ("train --preset none", "--preset none: no such preset"),
        ("train --horizon 0", "horizon: input should be greater than or equal to 1, not 0"),
        ("train --config /nowhere.yaml", "/nowhere.yaml: cannot be read"),
        ("train --device abacus", "--device abacus: give auto, cpu or cuda"),
        ("train --parts 65", "parts: there are not so many episodes; give at most 64"),
        (
            "train --on local:2",
            "--on: the episodes are flown in one part, so in one place; give --parts as well",
        ),
        ("train --parts 2 --on nowhere", "--on nowhere: give local:4"),
        ("train --out /proc/training", "--out /proc/training: cannot be written"),
    ],
)
def test_bad_usage_is_one_line_and_exit_code_2(monkeypatch, capsys, arguments, line):
    monkeypatch.setattr(sys, "argv", ["rsc-swarm", *arguments.split()])
    with pytest.raises(SystemExit) as left:
        cli.main()
    said = capsys.readouterr().err
    assert left.value.code == 2, said
    *before, last = said.splitlines()
    assert all(text.startswith("compiling") for text in before)  # where nothing has been compiled yet
    assert last.startswith(f"rsc-swarm: {line}")


def test_without_torch_one_line_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rsc_swarm.training.dagger", None)
    monkeypatch.setattr(sys, "argv", ["rsc-swarm", "train"])
    with pytest.raises(SystemExit) as left:
        cli.main()
    assert left.value.code == 3  # not one of the packages: told as it is

    monkeypatch.delitem(sys.modules, "rsc_swarm.training.dagger")
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(SystemExit) as left:
        cli.main()
    assert left.value.code == 2
    assert (
        "training needs torch: pip install -e '.[train]', in the clone of rsc-swarm"
        in capsys.readouterr().err
    )


_LOOK = """
import json, sys
import numpy as np
from pathlib import Path
from agent.policy.model_file import read_model
from agent.policy.session import open_session
from protocols.mission.document import Mission
from rsc_swarm.study.accuracy import mae
session = open_session(Path(sys.argv[1]).read_bytes())
shapes = {value.name: [1, *value.shape[1:]] for value in session.get_inputs()}
said = session.run(None, {name: np.ones(shape, np.float32) for name, shape in shapes.items()})
about = session.get_modelmeta().custom_metadata_map
assert read_model(Path(sys.argv[1])).facts.horizon == 4
planned, steady = mae(Path(sys.argv[1]), Mission(agents=4, fly_s=0.5), range(1_000_000, 1_000_002))
print(json.dumps([shapes, [list(value.shape) for value in said], about, planned, steady]))
"""


def test_the_command_leaves_a_model_file_that_any_drone_can_read(tmp_path, monkeypatch, capsys, unexported):
    config, folder = tmp_path / "tiny.yaml", tmp_path / "out"
    config.write_text(yaml.safe_dump(TINY))
    command = [sys.executable, "-m", "rsc_swarm", "train", "--config", str(config), "--out", str(folder)]
    first = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert first.stdout.startswith(f"{folder}/model.onnx: ")
    assert sorted(path.name.split(".")[0] for path in folder.iterdir()) == [
        "checkpoint",
        "curve",
        "events",
        "model",
        "model",
    ]
    monkeypatch.setattr(sys, "argv", ["rsc-swarm", *command[3:]])  # once more, and nothing is left to do
    with pytest.raises(SystemExit) as left:
        cli.main()
    assert (left.value.code, capsys.readouterr().out) == (0, first.stdout)

    looked = subprocess.run(
        [sys.executable, "-c", _LOOK, str(folder / "model.onnx")],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    inputs, outputs, about, planned, steady = json.loads(looked.stdout)
    assert inputs == {
        "own": [1, 3, 18],
        "heard": [1, 3, 8, 18],
        "share": [1, 3, 8],
        "target": [1, 2],
        "extra": [1, WIDE_SIZE],
    }
    assert outputs == [[1, 4, 2], [1, 4, 2]]
    assert (about["format"], about["version"], about["kind"], about["horizon"]) == (
        "rsc-swarm-policy",
        "1",
        "rsc",
        "4",
    )
    assert TrainingConfig.model_validate_json(about["config"]).width == 8
    assert 0 < planned < 10 * steady


@pytest.mark.parametrize(
    ("epochs", "updates", "said"),
    [
        (0, None, "in epoch 1 of 2; nothing is kept"),
        (
            1,
            240,
            "in epoch 2 of 2; the first epoch and of this one its flights and 240 of 480 updates are kept",
        ),
        (2, None, "while the model was written; all epochs are kept"),
    ],
)
def test_who_stops_a_training_is_told_what_is_kept(epochs, updates, said, tmp_path, monkeypatch):
    def stopped(config, folder, device, threads, progress, executor):
        progress.begin(config, [])
        for _ in range(epochs):
            progress.epoch({"loss": 1.0})
        if updates is not None:
            progress.kept(updates)
        raise KeyboardInterrupt

    monkeypatch.setattr("rsc_swarm.training.dagger.train", stopped)
    left = CliRunner().invoke(app, ["train", "--epochs", "2", "--out", str(tmp_path)])
    assert left.exit_code == 130
    assert f"stopped {said}, and the same command goes on from there" in left.output
