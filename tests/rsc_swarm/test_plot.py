"""The picture of a flight. That it looks good is for eyes; that it shows the flight is tested here."""

import sys

import numpy as np
import pytest

from protocols.mission import Mission
from rsc_swarm import plot_command
from rsc_swarm.canvas import PlotError
from rsc_swarm.flight import fly
from rsc_swarm.options import MissionOptions
from rsc_swarm.plot import Track, _collision, _edges, draw, load_track
from rsc_swarm.plot_command import Subject
from rsc_swarm.rundir import RunDir, RunDirError

pytest.importorskip("matplotlib")

PNG = b"\x89PNG\r\n"


def flown(tmp_path, mission: Mission) -> Track:
    path = tmp_path / "trajectory.npz"
    outcome = fly(mission, trajectory=path).outcome
    return load_track(path, outcome.tau_s, outcome.failure, "a flight")


def test_a_flight_with_everything_that_can_happen_is_drawn(tmp_path):
    mission = Mission(
        agents=9,
        start={"scrambled": True},
        time_limit_s=3.0,
        faults=[{"at_s": 1.5, "kind": "kill", "agents": [2]}],
    )
    track = flown(tmp_path, mission)
    assert np.diff(track.slots, axis=0).any()
    for name in ("flight.png", "flight.svg"):
        draw([(track, mission)], tmp_path / name)
    assert (tmp_path / "flight.png").read_bytes().startswith(PNG)


def test_only_edges_between_flying_drones_are_drawn(tmp_path):
    mission = Mission(agents=9, time_limit_s=1.0, faults=[{"at_s": 0.5, "kind": "kill", "slots": [4]}])
    track = flown(tmp_path, mission)
    assert len(_edges(track, mission.plan, 0)) == 8
    assert len(_edges(track, mission.plan, -1)) == 8 - sum(4 in edge for edge in mission.plan.edges)


def test_a_collision_is_marked_where_it_was(tmp_path):
    wall = [(12.0, 0.0, 2.0)]
    mission = Mission(
        agents=1, policy="cruise", safety_filter=False, start={"radius_m": 0}, obstacles={"discs": wall}
    )
    track = flown(tmp_path, mission)
    assert track.failure == "collision"
    x, y = _collision(track)
    assert np.hypot(x - 12.0, y) - 2.0 == pytest.approx(0.5, abs=0.1)
    draw([(track, mission)], tmp_path / "crash.png")


def test_a_recorded_flight_is_drawn_without_flying_it_again(tmp_path, capsys):
    mission = Mission(agents=4, time_limit_s=0.5)
    folder = RunDir(tmp_path / "run")
    folder.begin(mission)
    fly(mission, trajectory=folder.trajectory)
    plot_command.run(MissionOptions(), tmp_path / "run.png", Subject(run_dir=folder.path))
    assert (tmp_path / "run.png").read_bytes().startswith(PNG)
    assert capsys.readouterr().out == f"{tmp_path / 'run.png'}: 4 drones: interrupted\n"


def test_what_cannot_be_drawn_is_refused_in_one_line(tmp_path):
    with pytest.raises(RunDirError, match="no flight recorded here"):
        plot_command.run(MissionOptions(), tmp_path / "x.png", Subject(run_dir=tmp_path))
    with pytest.raises(PlotError, match=r"--map: --run-dir draws what was flown already"):
        plot_command.run(MissionOptions(map=3), tmp_path / "x.png", Subject(run_dir=tmp_path))
    with pytest.raises(PlotError, match="give a file in a directory that exists"):
        plot_command.run(MissionOptions(), tmp_path / "nowhere" / "x.png", Subject())
    with pytest.raises(PlotError, match=r"cannot be written \(Format 'xyz' is not supported"):
        plot_command.run(
            MissionOptions(agents=1, set=["time_limit_s=0.1"]), tmp_path / "flight.xyz", Subject()
        )
    (tmp_path / "bad.npz").write_text("not a flight")
    with pytest.raises(PlotError, match="is not a recorded flight"):
        load_track(tmp_path / "bad.npz", None, None, "")


def test_without_matplotlib_it_says_what_to_install(tmp_path, monkeypatch):
    track = flown(tmp_path, Mission(agents=1, time_limit_s=0.1))
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(PlotError, match=r"pip install 'rsc-swarm\[plot\]'"):
        draw([(track, Mission(agents=1))], tmp_path / "x.png")
