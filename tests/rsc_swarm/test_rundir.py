"""The directory a flight leaves behind, and which directories are left alone."""

import json

import numpy as np
import pytest

from protocols.mission.document import Mission, parse_mission, read_mission_fields
from rsc_swarm.flight.in_process import fly
from rsc_swarm.flight.run_dir import RunDir, RunDirError
from rsc_swarm.show.render import plain, render
from rsc_swarm.show.report import report_of

SMALL = Mission(agents=4, time_limit_s=1.0)


def test_everything_about_the_flight_is_in_it(tmp_path):
    folder = RunDir(tmp_path / "new" / "flight")
    folder.begin(SMALL)
    flown = fly(SMALL, trajectory=folder.trajectory)
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
        "logs", "mission.yaml", "report.json", "report.txt", "trajectory.npz"
    ]  # fmt: skip


def test_a_second_flight_replaces_the_first(tmp_path):
    folder = RunDir(tmp_path)
    folder.begin(SMALL)
    folder.report.write_text("the first flight's")
    (folder.logs / "agent-3.log").write_text("the first flight's")
    folder.begin(SMALL.model_copy(update={"map_seed": 9}))
    assert not folder.report.exists()
    assert not list(folder.logs.iterdir())


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


def test_an_interrupted_flight_keeps_its_paths(tmp_path):
    def stop(snapshot: object) -> None:
        raise KeyboardInterrupt

    path = tmp_path / "trajectory.npz"
    with pytest.raises(KeyboardInterrupt):
        fly(SMALL, on_snapshot=stop, trajectory=path)
    with np.load(path) as saved:
        assert 1 < len(saved["positions"]) < 101
    assert [entry.name for entry in tmp_path.iterdir()] == ["trajectory.npz"]
