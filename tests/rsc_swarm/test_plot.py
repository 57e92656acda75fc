"""The picture of a flight. That it looks good is for eyes; that it shows the flight is tested here."""

import json
import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from protocols.mission.document import Mission, MissionError
from protocols.whole_file import WriteError
from rsc_swarm.cli import pictures as plot_command
from rsc_swarm.cli.pictures import Subject
from rsc_swarm.flight.events import End
from rsc_swarm.flight.in_process import fly
from rsc_swarm.flight.recorded import Recorded
from rsc_swarm.flight.run_dir import RunDir, RunDirError
from rsc_swarm.options import MissionOptions
from rsc_swarm.show.plots.curves import read_curve
from rsc_swarm.show.plots.film import film
from rsc_swarm.show.plots.flight import draw, edges, free_place
from rsc_swarm.show.plots.style import PlotError, look
from rsc_swarm.study.intervals import wilson
from rsc_swarm.study.tables.result import RowResult, TableResult, write_table
from rsc_swarm.study.tables.table import Paper
from tests.disk import full_disk
from world.outlets.recorder import Recorder
from world.outlets.trajectory import Trajectory, TrajectoryError

pytest.importorskip("matplotlib")
Image = pytest.importorskip("PIL.Image")

PNG = b"\x89PNG\r\n"


def flown(tmp_path, mission: Mission) -> Recorded:
    recorder = Recorder(mission)
    outcome = fly(mission, recorder=recorder).outcome
    recorder.save(tmp_path / "trajectory.npz")
    path = Trajectory.load(tmp_path / "trajectory.npz")
    return Recorded(mission, path, End(outcome.failure, ""), outcome.tau_s)


def test_a_flight_with_everything_that_can_happen_is_drawn(tmp_path):
    mission = Mission(
        agents=9,
        start={"scrambled": True},
        fly_s=3.0,
        faults=[{"at_s": 1.5, "kind": "kill", "agents": [2]}],
    )
    track = flown(tmp_path, mission)
    assert np.diff(track.path.slots, axis=0).any()
    for name in ("flight.png", "flight.svg"):
        draw([track], tmp_path / name)
    assert (tmp_path / "flight.png").read_bytes().startswith(PNG)


def test_only_edges_between_flying_drones_are_drawn(tmp_path):
    mission = Mission(agents=9, fly_s=1.0, faults=[{"at_s": 0.5, "kind": "kill", "slots": [4]}])
    track = flown(tmp_path, mission)
    assert len(edges(track.path, mission.layout, 0)) == 8
    parent = mission.layout.parent
    assert len(edges(track.path, mission.layout, -1)) == 8 - (parent[4] >= 0) - (parent == 4).sum()


def texts(figure) -> list[str]:
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def test_drones_and_obstacles_carry_the_numbers_of_the_report(tmp_path, monkeypatch):
    discs = [(20.0, 0.0, 1.0), (20.0, 0.5, 1.0)]
    faults = [{"at_s": 1.0, "kind": "restart", "agents": [2]}, {"at_s": 2.0, "kind": "kill", "agents": [1]}]
    mission = Mission(agents=3, fly_s=3.0, obstacles={"discs": discs}, faults=faults)
    track = flown(tmp_path, mission)
    figures = []
    monkeypatch.setattr("rsc_swarm.show.plots.flight.save", lambda figure, out: figures.append(figure))
    draw([track], tmp_path / "x.png")
    written = texts(figures[0])
    assert [written.count(number) for number in "012"] == [1 + 2, 1 + 1 + 1, 2 + 1]  # obstacles, ends, faults
    legend = [text.get_text() for text in figures[0].axes[0].get_legend().get_texts()]
    assert legend == ["start", "at the end", "lost", "restarted", "obstacle", "goal"]


def test_the_numbers_of_obstacles_that_overlap_stand_apart():
    discs = np.array([[20.0, 0.0, 1.0], [20.0, 0.2, 1.0], [30.0, 0.0, 1.0]])
    places = [free_place(discs, index) for index in range(3)]
    assert np.linalg.norm(places[0] - places[1]) > 1.0
    assert places[2].tolist() == [30.0, 0.0]


def test_the_shortest_flight_is_drawn(tmp_path):
    for agents in (1, 2):
        mission = Mission(agents=agents, fly_s=0.01, obstacles={"discs": []})
        draw([flown(tmp_path, mission)], tmp_path / "short.png")


def test_a_collision_is_marked_where_it_was(tmp_path):
    wall = [(12.0, 0.0, 2.0)]
    mission = Mission(
        agents=1, policy="cruise", safety_filter=False, start={"radius_m": 0}, obstacles={"discs": wall}
    )
    track = flown(tmp_path, mission)
    assert track.failure == "collision"
    x, y = next(event.place_m for event in track.events if event.what == "collision")
    assert np.hypot(x - 12.0, y) - 2.0 == pytest.approx(0.5, abs=0.1)
    draw([track], tmp_path / "crash.png")


def test_a_recorded_flight_is_drawn_without_flying_it_again(tmp_path, capsys):
    mission = Mission(agents=4, fly_s=0.5)
    folder = RunDir(tmp_path / "run")
    folder.begin(mission)
    recorder = Recorder(mission)
    fly(mission, recorder=recorder)
    recorder.save(folder.trajectory)
    plot_command.make(MissionOptions(), tmp_path / "run.png", Subject(run_dir=folder.path))
    assert (tmp_path / "run.png").read_bytes().startswith(PNG)
    assert capsys.readouterr().out == f"{tmp_path / 'run.png'}: 4 drones: interrupted\n"


def test_settings_of_matplotlib_that_do_not_let_it_draw_are_told(tmp_path, monkeypatch):
    env = {**os.environ, "MPLBACKEND": "nonsense"}
    words = [sys.executable, "-m", "rsc_swarm", "plot", "--agents", "1", "--set", "fly_s=0.1"]
    asked = subprocess.run(words, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    assert asked.returncode == 2
    assert "matplotlib cannot draw by its settings: look at MPLBACKEND" in asked.stderr.splitlines()[-1]

    def unable(*_: object, **__: object) -> None:
        raise RuntimeError("latex could not be found")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", unable)
    with pytest.raises(PlotError, match=r"by its settings: .+ \(latex could not be found\)"):
        plot_command.make(MissionOptions(agents=1, set=["fly_s=0.1"]), tmp_path / "flight.png", Subject())


def test_who_draws_keeps_the_backend_that_was_chosen(tmp_path):
    import matplotlib

    with matplotlib.rc_context({"backend": "svg"}):
        plot_command.make(MissionOptions(agents=1, set=["fly_s=0.1"]), tmp_path / "flight.png", Subject())
        assert matplotlib.get_backend() == "svg"


def test_what_cannot_be_drawn_is_refused_in_one_line(tmp_path):
    with pytest.raises(RunDirError, match="no flight recorded here"):
        plot_command.make(MissionOptions(), tmp_path / "x.png", Subject(run_dir=tmp_path))
    with pytest.raises(PlotError, match=r"--map: --run-dir draws what was flown already"):
        plot_command.make(MissionOptions(map=3), tmp_path / "x.png", Subject(run_dir=tmp_path))
    with pytest.raises(MissionError, match="give a file in a directory that exists"):
        plot_command.make(MissionOptions(), tmp_path / "nowhere" / "x.png", Subject())
    with pytest.raises(PlotError, match=r"flight.xyz: give a file that ends in .png, .svg or .pdf"):
        plot_command.make(MissionOptions(agents=1, set=["fly_s=0.1"]), tmp_path / "flight.xyz", Subject())
    out = tmp_path / "flight.png"
    out.write_text("an earlier one")
    with full_disk(1000), pytest.raises(WriteError, match=rf"^{out}: cannot be written \(File too large\)"):
        plot_command.make(MissionOptions(agents=1, set=["fly_s=0.1"]), out, Subject())
    assert out.read_text() == "an earlier one"
    (tmp_path / "bad.npz").write_text("not a flight")
    with pytest.raises(TrajectoryError, match="is not a recorded flight"):
        Trajectory.load(tmp_path / "bad.npz")


SHORT = Mission(agents=3, fly_s=0.6, faults=[{"at_s": 0.3, "kind": "kill", "agents": [1]}])


def test_a_film_shows_a_flight_from_its_start_to_its_end(tmp_path):
    track, drawn = flown(tmp_path, SHORT), []
    film(track, tmp_path / "flight.gif", "gif", lambda done, total: drawn.append((done, total)))
    with Image.open(tmp_path / "flight.gif") as moving:
        assert moving.n_frames == len(drawn) == 4
        pictures = []
        for place in range(4):
            moving.seek(place)
            pictures.append(np.asarray(moving.convert("RGB")).astype(int))
    assert drawn == [(0, 4), (1, 4), (2, 4), (3, 4)]
    assert all(np.abs(after - before).max() > 100 for before, after in pairwise(pictures))


def of_ffmpeg(folder, script: str, monkeypatch) -> None:
    """There is an ffmpeg that does this."""
    (folder / "ffmpeg").write_text(f"#!/bin/sh\n{script}\n")
    (folder / "ffmpeg").chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:/usr/bin:/bin")


def test_ffmpeg_gets_every_picture_whole(tmp_path, monkeypatch):
    of_ffmpeg(tmp_path, 'for last; do :; done; cat > "$last"', monkeypatch)
    film(flown(tmp_path, SHORT), tmp_path / "flight.mp4", "mp4")
    pictures, rest = divmod(len((tmp_path / "flight.mp4").read_bytes()), 3 * 960)
    assert rest == 0
    assert pictures % (16 + 50) == 0, "every 40 ms, and the last one for two seconds more"


def test_what_keeps_a_film_from_being_made_is_told_in_one_line(tmp_path, monkeypatch):
    track, out = flown(tmp_path, SHORT), tmp_path / "flight.mp4"
    of_ffmpeg(tmp_path, "echo 'Unknown encoder' >&2; exit 1", monkeypatch)
    with pytest.raises(PlotError, match=rf"^--mp4 {out}: ffmpeg cannot make it \(Unknown encoder\)$"):
        film(track, out, "mp4")
    monkeypatch.setenv("PATH", "")
    with pytest.raises(
        PlotError, match=rf"^--mp4 {out}: needs ffmpeg, which is not here: apt install ffmpeg"
    ):
        film(track, out, "mp4")
    assert not out.exists()
    with pytest.raises(PlotError, match=r"^--gif: a film shows one flight; leave --compare out$"):
        plot_command.make(MissionOptions(), None, Subject(compare="4,9"), {"gif": tmp_path / "x.gif"})
    with pytest.raises(
        MissionError, match=r"^--gif .*nowhere/x.gif: give a file in a directory that exists$"
    ):
        plot_command.make(MissionOptions(), None, Subject(), {"gif": tmp_path / "nowhere" / "x.gif"})


def test_of_films_alone_no_picture_is_drawn(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    plot_command.make(MissionOptions(agents=1, set=["fly_s=0.1"]), None, Subject(), {"gif": Path("x.gif")})
    assert [path.name for path in tmp_path.iterdir()] == ["x.gif"]
    assert capsys.readouterr().out == "x.gif: 1 drone: late\n"


def test_two_sizes_are_drawn_to_one_scale(tmp_path, capsys):
    options = MissionOptions(set=["fly_s=0.1"])
    plot_command.make(options, tmp_path / "two.png", Subject(compare="4,9"))
    assert (tmp_path / "two.png").read_bytes().startswith(PNG)
    assert capsys.readouterr().out.endswith("two.png: 4 drones: late; 9 drones: late\n")
    with pytest.raises(PlotError, match="--compare 4,x: write numbers of drones"):
        plot_command.make(options, tmp_path / "two.png", Subject(compare="4,x"))
    with pytest.raises(PlotError, match="--agents: --compare says how many"):
        plot_command.make(MissionOptions(agents=9), tmp_path / "two.png", Subject(compare="4,9"))
    with pytest.raises(PlotError, match="--run-dir --compare: these are different pictures"):
        plot_command.make(options, tmp_path / "two.png", Subject(run_dir=tmp_path, compare="4,9"))


def horizon_row(name: str, way: str, rate: float) -> RowResult:
    nothing = dict.fromkeys(("tau_mean_s", "formed_mean_s", "min_distance_m", "accuracy"))
    return RowResult(
        key=f"{name}/{way}", place="", name=name, way=way, agents=25, policy=name.lower(),
        paper=Paper(83.0, 13.17, 7.9, 2.5), runs=600, success_rate=rate, success_interval=wilson(round(600 * rate), 600),
        collision_rate=0.0, noncollision_rate=1 - rate, swaps_per_flight=0.0, maps=(0, 199), starts=3,
        failures={}, command="", code="", **nothing,
    )  # fmt: skip


def test_success_against_horizon_is_drawn_from_a_table(tmp_path, capsys):
    rows = [
        horizon_row(f"RSC-H{h}", way, 0.5 + h / 100)
        for h in (1, 20, 40)
        for way in ("ours", "as in the paper", "to the letter")
    ]
    write_table(tmp_path, TableResult(table="1", title="", rows=tuple(rows)), "")
    plot_command.make(MissionOptions(), tmp_path / "h.png", Subject(horizons=tmp_path / "table-1.json"))
    assert (tmp_path / "h.png").read_bytes().startswith(PNG)
    write_table(tmp_path, TableResult(table="1", title="", rows=(horizon_row("Saber", "", 0.1),)), "")
    with pytest.raises(PlotError, match="table 1 has no RSC rows yet"):
        plot_command.make(MissionOptions(), tmp_path / "h.png", Subject(horizons=tmp_path / "table-1.json"))


def test_the_way_from_the_letter_to_ours_is_drawn_from_a_table(tmp_path):
    keys = ("rsc-h20/letter", "rsc-h20/ours", "onward/rsc-h20/filter", "back/rsc-h20/detour")
    rows = [horizon_row("RSC-H20", key, 0.5).model_copy(update={"key": key}) for key in keys]
    write_table(tmp_path, TableResult(table="letter", title="", rows=tuple(rows)), "")
    plot_command.make(MissionOptions(), tmp_path / "l.png", Subject(letter=tmp_path / "table-letter.json"))
    assert (tmp_path / "l.png").read_bytes().startswith(PNG)
    write_table(tmp_path, TableResult(table="letter", title="", rows=tuple(rows[:3])), "")
    with pytest.raises(PlotError, match="table letter lacks rows of the steps"):
        plot_command.make(
            MissionOptions(), tmp_path / "l.png", Subject(letter=tmp_path / "table-letter.json")
        )


def test_learning_curves_are_drawn_from_what_training_wrote(tmp_path):
    line = {"updates": 0, "seconds": 0.1, "loss": 1.0, "mae_m": 1e-3, "mixing": 1.0, "success": None}
    path = tmp_path / "curve.jsonl"
    path.write_text("".join(f"{json.dumps({**line, 'update': update})}\n" for update in (0, 100, 200)))
    plot_command.make(MissionOptions(), tmp_path / "c.png", Subject(curve=(tmp_path, tmp_path)))
    assert (tmp_path / "c.png").read_bytes().startswith(PNG)
    path.write_text("no curve\n")
    with pytest.raises(PlotError, match="is not the curve of a training"):
        read_curve(tmp_path)
    with pytest.raises(PlotError, match=r"nowhere/curve.jsonl: cannot be read \(No such file or directory\)"):
        read_curve(tmp_path / "nowhere")


def test_however_many_lines_there_are_none_looks_like_another():
    looks = [look(number) for number in range(24)]
    assert all(looks.count(one) == 1 for one in looks)


def test_without_matplotlib_it_says_what_to_install(tmp_path, monkeypatch):
    track = flown(tmp_path, Mission(agents=1, fly_s=0.1))
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(PlotError, match="plot needs matplotlib: pip install matplotlib"):
        draw([track], tmp_path / "x.png")
