"""The folder of a training: of one config, of one command at a time, and whole or named."""

import json

import pytest
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from protocols.whole_file import WriteError
from rsc_swarm.training.board import Board
from rsc_swarm.training.checkpoint import TrainingFolder
from rsc_swarm.training.config import TrainingError
from rsc_swarm.training.dagger import train
from rsc_swarm.training.watcher import Nobody
from tests.disk import full_disk


class StoppedInTheFirst(Nobody):
    """Presses Ctrl-C when the flights of the first epoch are kept."""

    def kept(self, updates):
        raise KeyboardInterrupt


def test_a_training_from_before_a_field_was_there_goes_on(tiny, tmp_path, unexported):
    train(tiny.model_copy(update={"epochs": 1}), tmp_path, "cpu", 1, Nobody())
    state = torch.load(tmp_path / "checkpoint.pt", weights_only=True)
    older = json.loads(state["config"])
    del older["parts"]
    torch.save({**state, "config": json.dumps(older)}, tmp_path / "checkpoint.pt")
    assert TrainingFolder(tmp_path, tiny.model_copy(update={"epochs": 1})).load()
    with pytest.raises(TrainingError, match="holds a training with parts 1, not 3; give another folder"):
        TrainingFolder(tmp_path, tiny.model_copy(update={"epochs": 1, "parts": 3})).load()


def test_a_folder_with_another_training_is_refused(tiny, tmp_path, unexported):
    short = tiny.model_copy(update={"epochs": 1})
    train(short, tmp_path, "cpu", 1, Nobody())
    with pytest.raises(TrainingError, match="holds a training with width 8, not 16; give another folder"):
        TrainingFolder(tmp_path, short.model_copy(update={"width": 16})).load()


def test_one_command_at_a_time_trains_in_a_folder(tiny, tmp_path):
    first = TrainingFolder(tmp_path, tiny)
    with first.alone(), pytest.raises(TrainingError, match="another command trains here; wait for it"):
        train(tiny, tmp_path, "cpu", 1, Nobody())
    with first.alone():
        pass


def test_what_was_kept_amid_the_first_epoch_is_of_one_training_too(tiny, tmp_path, unexported):
    with pytest.raises(KeyboardInterrupt):
        train(tiny, tmp_path, "cpu", 1, StoppedInTheFirst())
    assert (tmp_path / "within.pt").exists()
    with pytest.raises(TrainingError, match="holds a training with seed 0, not 5; give another folder"):
        train(tiny.model_copy(update={"seed": 5}), tmp_path, "cpu", 1, Nobody())
    train(tiny, tmp_path, "cpu", 1, Nobody())


@pytest.mark.parametrize("damage", [b"", b"not a checkpoint", None])
def test_a_damaged_checkpoint_is_one_line(tiny, tmp_path, unexported, damage):
    train(tiny.model_copy(update={"epochs": 1}), tmp_path, "cpu", 1, Nobody())
    file = tmp_path / "checkpoint.pt"
    file.write_bytes(file.read_bytes()[:2000] if damage is None else damage)
    with pytest.raises(TrainingError, match=r"checkpoint.pt: is missing or damaged; remove .* train anew"):
        TrainingFolder(tmp_path, tiny).load()


def test_a_checkpoint_for_which_there_is_no_room_is_named(tiny, tmp_path, unexported):
    with pytest.raises(WriteError, match=r"\.pt: cannot be written \(File too large\)$"), full_disk(4096):
        train(tiny.model_copy(update={"epochs": 1}), tmp_path, "cpu", 1, Nobody())


def test_tensorboard_shows_each_epoch_once_also_after_a_stop(tmp_path):
    for first, values in ((0, [3.0, 2.0, 9.0]), (2, [1.0, 0.5])):
        with Board(tmp_path, first) as board:
            for epoch, value in enumerate(values, first):
                board.add(epoch, {"loss": value})
        (tmp_path / "later").mkdir(exist_ok=True)
        for file in tmp_path.glob("events.*"):
            file.rename(tmp_path / "later" / f"{file.name}.{first}")
    shown = EventAccumulator(str(tmp_path / "later")).Reload().Scalars("loss")
    assert [(point.step, point.value) for point in shown] == [(0, 3.0), (1, 2.0), (2, 1.0), (3, 0.5)]


def test_curves_for_which_there_is_no_room_are_told_in_a_line(tmp_path, capfd):
    with (
        full_disk(0),
        pytest.raises(WriteError, match=r"events\.out\..*: cannot be written \(File too large\)$"),
    ):
        Board(tmp_path, 0)
    with pytest.raises(WriteError, match=r"nowhere/events.*: cannot be written"):
        Board(tmp_path / "nowhere", 0)
    assert capfd.readouterr().err == ""
