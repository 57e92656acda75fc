"""Model files: what is no policy, is damaged or does not keep its word is refused in one line."""

import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

from agent.policy import PolicyError, find_policy, policy_names
from agent.policy.model_file import SHIPPED, ModelFileError, note_of, shipped_models
from protocols.mission.document import parse_mission
from rsc_swarm.training import describe as describing
from rsc_swarm.training.describe import describe
from tests.models import random_model, saved, straight_on, written

HORIZON = 10


@pytest.fixture
def model(tmp_path: Path) -> Path:
    return written(tmp_path / "still.onnx", HORIZON, straight_on(HORIZON))


def refusal(path: Path, **fields: Any) -> str:
    mission = parse_mission({"agents": 6, "policy": str(path), **fields})
    with pytest.raises(PolicyError) as caught:
        find_policy(str(path), mission).open()  # type: ignore[attr-defined]
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    assert (
        refusal(tmp_path / "no.onnx")
        == f"policy: {tmp_path}/no.onnx: cannot be read (No such file or directory)"
    )
    folder = tmp_path / "folder.onnx"
    folder.mkdir()
    assert refusal(folder) == f"policy: {folder}: cannot be read (Is a directory)"


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_a_file_that_was_cut_off_is_refused(tmp_path: Path, share: float) -> None:
    path = saved(tmp_path / "cut.onnx", random_model(HORIZON, 16))
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    why = f"policy: {path}: is not the file that its note cut.json was written for: damaged, cut off or exchanged; "
    assert refusal(path).startswith(why)


def test_a_model_without_its_note_is_refused(model: Path) -> None:
    note_of(model).unlink()
    assert refusal(model) == (
        f"policy: {model}: its note still.json is not beside it; copy it too, or make it: "
        f"python -m rsc_swarm.training.describe {model}"
    )


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": "other"}', "\xff", "[" * 100_000, "1e999"])
def test_a_note_of_another_kind_is_refused(model: Path, text: str) -> None:
    note_of(model).write_text(text, encoding="latin-1")
    note = note_of(model)
    assert refusal(model) == f"policy: {note}: is no note of a policy: it lacks format = rsc-swarm-policy"


def test_the_notes_of_shipped_models_say_what_their_files_say(tmp_path: Path) -> None:
    for name in shipped_models():
        copy = shutil.copy(SHIPPED / f"{name}.onnx", tmp_path)
        describe(Path(copy))
        assert note_of(Path(copy)).read_text() == note_of(SHIPPED / f"{name}.onnx").read_text()


def test_who_names_no_model_is_told_what_to_name(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["describe"])
    with pytest.raises(SystemExit) as left:
        describing.main()
    assert left.value.code == 2
    assert capsys.readouterr().err.startswith("name the model files: python -m rsc_swarm.training.describe")


@pytest.mark.parametrize(
    "content", [b"PK\x03\x04 a zip archive", b"agents: 25\n", bytes(1000), b"\xff" * 100]
)
def test_a_file_of_another_kind_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "other.onnx"
    path.write_bytes(content)
    with pytest.raises(
        ModelFileError, match=r"other.onnx: is damaged, cut off, or no ONNX file|lacks format"
    ):
        describe(path)
    assert "its note other.json is not beside it" in refusal(path)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        (
            {"format": "other"},
            "is no note of a policy: it lacks format = rsc-swarm-policy",
        ),
        ({"version": "2"}, "cannot be flown by this version: version: input should be '1', not '2'"),
        ({"features": "9"}, "cannot be flown by this version: features: input should be '1', not '9'"),
        ({"horizon": "many"}, "cannot be flown by this version: horizon: write a whole number"),
        (
            {"output": "words"},
            "cannot be flown by this version: output: input should be 'knots', 'raw' or 'action'",
        ),
        ({"horizon": "12"}, "acceleration: should be (B, 12, 2), but is (B, 10, 2)"),
        ({"neighbours": "6"}, "heard: should be (B, 3, 6, 18), but is (B, 3, 8, 18)"),
        ({"extra": "wide"}, "extra: should be (B, 32), but is absent"),
        ({"replan": "20"}, "replan: 20 ticks, but it plans only 10"),
    ],
)
def test_a_file_that_does_not_keep_its_word_is_refused(
    tmp_path: Path, changes: dict[str, str], why: str
) -> None:
    path = tmp_path / "wrong.onnx"
    with pytest.raises(ModelFileError) as caught:
        written(path, HORIZON, straight_on(HORIZON), **changes)
    assert str(caught.value).startswith(f"{path}: {why}")


def test_a_model_that_cannot_run_is_refused_when_it_is_opened(tmp_path: Path) -> None:
    body = straight_on(HORIZON).replace("Mul", "Nonsense")
    assert "cannot be run (" in refusal(written(tmp_path / "wrong.onnx", HORIZON, body))


def test_planning_more_seldom_than_plans_last_is_refused(model: Path) -> None:
    why = refusal(model, trajectory={"replan_ticks": 11})
    assert why == f"trajectory.replan_ticks: 11, but {model} plans 10 ticks; give at most that"


def test_shipped_models_are_known_by_name_and_in_order() -> None:
    for name in shipped_models():
        assert name in policy_names()
        find_policy(name, parse_mission({"policy": name}))
