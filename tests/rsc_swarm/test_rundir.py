"""The directory a flight leaves behind, and which directories are left alone."""

import hashlib
import json
import os
import subprocess
from pathlib import Path

import numba
import numpy as np
import pytest

from agent.policy import files_of, find_policy
from agent.policy.model_file import SHIPPED, note_of
from protocols.mission.document import Mission, parse_mission, read_mission_fields
from rsc_swarm.flight.events import end_of
from rsc_swarm.flight.in_process import fly
from rsc_swarm.flight.provenance import provenance
from rsc_swarm.flight.recorded import Recorded
from rsc_swarm.flight.report import report_of
from rsc_swarm.flight.run_dir import Ended, RunDir, RunDirError
from rsc_swarm.show.render import plain, render
from world.outlets.recorder import Recorder

HOMING = """
class Homing:
    def __init__(self, mission):
        pass

    def act(self, seen):
        return GAIN * seen.slot_error
"""
SMALL = Mission(agents=4, fly_s=1.0)


def test_everything_about_the_flight_is_in_it(tmp_path):
    folder = RunDir(tmp_path / "new" / "flight")
    folder.begin(SMALL)
    recorder = Recorder(SMALL)
    flown = fly(SMALL, recorder=recorder)
    folder.save_path(recorder.trajectory, recorder.mission, end_of(flown, SMALL))
    report = report_of(flown, SMALL, "simulate", "lockstep", "")
    folder.finish(report, plain(render(report)))
    assert parse_mission(read_mission_fields(folder.mission)) == SMALL
    assert json.loads(folder.report.read_text())["digest"] == flown.outcome.digest
    assert folder.text.read_text().startswith("FAILED (late)")
    with np.load(folder.trajectory) as saved:
        assert saved["positions"].shape == saved["velocities"].shape == (101, 4, 2)
        assert saved["slots"].shape == saved["flying"].shape == (101, 4)
        np.testing.assert_allclose(np.diff(saved["positions"], axis=0)[0], 0.005 * saved["velocities"][1])
    assert sorted(path.name for path in folder.path.iterdir()) == [
        "events.jsonl", "logs", "mission.yaml", "report.json", "report.txt", "trajectory.npz"
    ]  # fmt: skip


def test_a_second_flight_replaces_the_first_only_if_that_is_asked_for(tmp_path):
    folder = RunDir(tmp_path)
    folder.begin(SMALL)
    folder.begin(SMALL)  # nothing was flown
    folder.report.write_text("the first flight's")
    (folder.logs / "agent-3.log").write_text("the first flight's")
    folder.page.write_text("the first flight's")
    with pytest.raises(RunDirError) as refused:
        folder.begin(SMALL)
    assert str(refused.value) == (
        f"--run-dir {tmp_path}: holds a flight already; give a new directory, or --overwrite"
    )
    assert folder.report.read_text() == "the first flight's"
    folder.begin(SMALL.model_copy(update={"map_seed": 9}), overwrite=True)
    assert not folder.report.exists()
    assert not folder.page.exists()
    assert not list(folder.logs.iterdir())


def test_a_policy_of_ones_own_lies_in_it_and_is_found_from_anywhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = HOMING.replace("return GAIN", "from my_gains import GAIN\n        return GAIN")
    (tmp_path / "homing.py").write_text(text)
    (tmp_path / "my_gains.py").write_text("from more.gains import GAIN\n")
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "gains.py").write_text("GAIN = 1.0\n")
    mission = SMALL.model_copy(update={"policy": "homing.py:Homing"})
    folder = RunDir(tmp_path / "flights" / "1")
    files = files_of(find_policy(mission.policy, mission))
    folder.begin(mission, files)
    assert list(provenance(files).policy_files) == ["homing.py", "more/gains.py", "my_gains.py"]
    first = fly(mission).outcome.digest
    for file in files:
        file.unlink()
    monkeypatch.chdir("/")
    kept = parse_mission(read_mission_fields(folder.mission))
    assert kept.policy == f"{tmp_path}/flights/1/policy/homing.py:Homing"
    assert fly(kept).outcome.digest == first
    again = files_of(find_policy(kept.policy, kept))
    assert provenance(files[:0]).policy_files == {}
    folder.begin(kept, again, overwrite=True)  # into its own folder
    assert parse_mission(read_mission_fields(folder.mission)) == kept
    kept_files = sorted(str(path.relative_to(folder.policy)) for path in folder.policy.rglob("*.py"))
    assert kept_files == ["homing.py", "more/gains.py", "my_gains.py"]


def test_what_lies_elsewhere_is_not_copied(tmp_path):
    for name in ("homing.py", "elsewhere/homing.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(name)
    folder = RunDir(tmp_path / "run")
    mission = SMALL.model_copy(update={"policy": f"{tmp_path}/homing.py:Homing"})
    folder.begin(mission, [tmp_path / "homing.py", tmp_path / "elsewhere" / "homing.py"])
    assert (folder.policy / "homing.py").read_text() == "homing.py"


def test_a_model_file_lies_in_it(tmp_path, monkeypatch):
    path = tmp_path / "mine.onnx"
    for file in (path, note_of(path)):
        file.write_bytes((SHIPPED / f"rsc-h10{file.suffix}").read_bytes())
    mission = SMALL.model_copy(update={"policy": str(path)})
    folder = RunDir(tmp_path / "run")
    folder.begin(mission, files_of(find_policy(mission.policy, mission)))
    assert "policy: policy/mine.onnx\n" in folder.mission.read_text()
    for file in (path, note_of(path)):
        assert (folder.policy / file.name).read_bytes() == file.read_bytes()


def test_a_report_says_with_what_it_was_flown(tmp_path):
    path = SHIPPED / "rsc-h20.onnx"
    told = provenance([path])
    assert told.policy_files == {"rsc-h20.onnx": hashlib.sha256(path.read_bytes()).hexdigest()}
    assert told.numba == numba.__version__
    head = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=Path(__file__).parent, capture_output=True, text=True
    )
    if head.returncode == 0:
        assert told.commit is not None
        assert told.commit.removesuffix("-dirty") == head.stdout.strip()


def test_other_things_are_never_touched(tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(RunDirError, match="give an empty or new directory"):
        RunDir(tmp_path).begin(SMALL)
    (tmp_path / "mission.yaml").write_text("agents: 4\n")  # a mission, but not one that a flight wrote
    with pytest.raises(RunDirError, match="give an empty or new directory"):
        RunDir(tmp_path).begin(SMALL)
    with pytest.raises(RunDirError, match="is a file"):
        RunDir(tmp_path / "thesis.tex").begin(SMALL)
    assert (tmp_path / "thesis.tex").read_text() == "mine"


def test_a_report_that_is_none_is_named(tmp_path):
    folder = RunDir(tmp_path)
    folder.begin(SMALL)
    assert folder.told()[0] == Ended(None, "interrupted"), "nobody came to write a report"
    folder.report.write_text('{"tau_s": 1.5, "failure": null, "since": "another version"}')
    assert folder.told()[0] == Ended(1.5, None)
    folder.report.write_text('{"tau_s": null, "failure": "\\u001b[31m"}')
    assert folder.told()[0].failure == "\\x1b[31m", "a terminal shows it and does not obey"
    for garbage in (b"", b"[]", b"\xff", b"[" * 100_000, b'{"tau_s": "x", "failure": 1e999}',
                    b'{"tau_s": NaN, "failure": null}', b'{"tau_s": -1, "failure": null}'):  # fmt: skip
        folder.report.write_bytes(garbage)
        with pytest.raises(RunDirError, match=rf"^{folder.report}: is not the report of a flight$"):
            folder.told()


def test_two_runs_at_once_do_not_write_into_one_directory(tmp_path):
    first = RunDir(tmp_path / "run")
    first.begin(SMALL)
    with pytest.raises(RunDirError) as refused:
        RunDir(tmp_path / "run").begin(SMALL, overwrite=True)
    assert str(refused.value) == (
        f"--run-dir {tmp_path}/run: another run writes there; give a new directory, or wait for its end"
    )
    del first
    RunDir(tmp_path / "run").begin(SMALL)


def test_a_flight_that_another_run_has_just_finished_there_is_not_overwritten(tmp_path, monkeypatch):
    """Between the look whether the directory is free and the moment in which it is ours, that run may have ended."""
    first, lock = RunDir(tmp_path / "run"), RunDir._lock
    first.begin(SMALL)
    folder = first.path
    del first

    def finished_meanwhile(self):
        (folder / "report.json").write_text("{}")
        lock(self)

    monkeypatch.setattr(RunDir, "_lock", finished_meanwhile)
    with pytest.raises(RunDirError, match="holds a flight already"):
        RunDir(folder).begin(SMALL)
    assert (folder / "report.json").exists()


@pytest.mark.parametrize("what", ["endless", "a pipe", "a folder", "itself"])
@pytest.mark.parametrize("name", ["mission", "trajectory", "report", "events"])
def test_of_what_is_no_file_a_flight_is_read_or_refused_at_once(name, what, tmp_path):
    """It was copied from somewhere, or somebody wants to know what happens."""
    folder = RunDir(tmp_path / "flight")
    folder.begin(SMALL)
    recorder = Recorder(SMALL)
    flown = fly(SMALL, recorder=recorder)
    folder.save_path(recorder.trajectory, recorder.mission, end_of(flown, SMALL))
    folder.finish(report_of(flown, SMALL, "simulate", "lockstep", ""), "")
    file = getattr(folder, name)
    file.unlink()
    if what == "a folder":
        file.mkdir()
    elif what == "a pipe":
        os.mkfifo(file)
    else:
        file.symlink_to("/dev/zero" if what == "endless" else file)
    if name in ("report", "events"):
        assert Recorded.load(folder).mission == SMALL
        return
    with pytest.raises(RunDirError, match=r"no flight recorded here"):
        Recorded.load(folder)
