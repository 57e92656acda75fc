"""A flight of a run directory, to be looked at again."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from agent.air.log import FlightLog
from rsc_swarm.air.folder import event_of, keep
from rsc_swarm.air.plans import read_plan
from rsc_swarm.cli.commands import loaded
from rsc_swarm.flight.run_dir import RunDir, RunDirError
from rsc_swarm.watch.replay import replay_of
from world.outlets.picture import unpacked
from world.outlets.trajectory import Trajectory


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    run = tmp_path_factory.mktemp("runs") / "one"
    fault = "faults=[{at_s: 0.5, kind: kill, agents: [1]}]"
    words = [
        "--agents",
        "4",
        "--set",
        "fly_s=1.5",
        "--set",
        fault,
        "--set",
        "radio.loss=0.3",
        "--run-dir",
        str(run),
    ]
    loaded()(["simulate", *words], standalone_mode=False)
    return run


@pytest.fixture
def run(kept: Path, tmp_path: Path) -> RunDir:
    return RunDir(Path(shutil.copytree(kept, tmp_path / "run")))


def test_a_flight_that_repeats_is_flown_again_and_shows_the_radio(run: RunDir) -> None:
    shares: list[float] = []
    told = replay_of(run, shares.append)
    assert told.recorded is None
    pictures = [unpacked(picture) for picture in told.pictures]
    assert [picture.tick for picture in pictures] == [*range(0, 150, 4), 150]
    path = Trajectory.load(run.trajectory)
    for picture in pictures:
        assert np.allclose(picture.drones[:, :2], path.positions[picture.tick], atol=1e-4)
    assert len(pictures[-1].links)
    assert shares[-1] == 1.0


@pytest.mark.parametrize(
    ("change", "why"),
    [({"digest": "0" * 32}, "another flight"), ({"clock": "realtime"}, "by the clock"), (None, "no report")],
)
def test_others_are_shown_as_they_were_recorded(run: RunDir, change: dict[str, str] | None, why: str) -> None:
    if change is None:
        run.report.unlink()
    else:
        run.report.write_text(json.dumps(json.loads(run.report.read_text()) | change))
    told = replay_of(run)
    assert told.recorded is not None
    assert why in told.recorded
    path = Trajectory.load(run.trajectory)
    for picture in map(unpacked, told.pictures):
        assert np.allclose(picture.drones[:, :2], path.positions[picture.tick], atol=1e-4)
        assert (picture.drones[:, 4] == path.slots[picture.tick]).all()
        assert ((picture.drones[:, 5] > 0) == path.flying[picture.tick]).all()


@pytest.mark.parametrize("said", [None, "x", float("inf"), {}])
def test_how_long_a_flight_was_its_path_says(run: RunDir, said: object) -> None:
    no_numbers = {"ticks": said, "wall_s": float("nan"), "first_tick_s": "beyond"}
    text = json.dumps(json.loads(run.report.read_text()) | no_numbers)
    run.report.write_text(text.replace('"beyond"', "1e999"))
    told = replay_of(run)
    assert told.recorded is None, "it was flown again"
    assert told.report is not None
    assert (told.report["wall_s"], told.report["first_tick_s"]) == (None, None), (
        "a page reads no such numbers"
    )


@pytest.mark.parametrize(
    "change",
    [
        {"goal_x": np.float64("inf")},
        {"tick_s": np.float64(0)},
        {"obstacles": np.full((1, 3), np.nan)},
        "slots",
        "no rows",
    ],
)
def test_what_is_no_path_is_no_flight_to_be_shown(run: RunDir, change: dict[str, object] | str) -> None:
    with np.load(run.trajectory) as kept:
        path = dict(kept)
    if change == "slots":
        path["slots"][3] = 99
    elif change == "no rows":
        path |= {name: path[name][:0] for name in ("positions", "velocities", "slots", "flying")}
    else:
        path |= change
    np.savez(run.trajectory, **path)
    with pytest.raises(RunDirError, match=r"trajectory.npz: is not the flight of the mission beside it$"):
        replay_of(run)


def test_a_folder_without_a_flight_is_said_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(RunDirError, match="no flight recorded here"):
        replay_of(RunDir(tmp_path))


def test_a_flight_on_the_air_is_shown_as_it_was_heard(tmp_path: Path) -> None:
    plan = read_plan(Path(__file__).parents[3] / "examples" / "room.yaml")
    log = FlightLog(plan)
    for tick in range(41):
        log.record(tick, {}, 0.0)
    keep(RunDir(tmp_path / "1"), plan, log, [event_of(0, 1.0, "fly", ["start"])], missed={0: 0})
    told = replay_of(RunDir(tmp_path / "1"))
    assert told.recorded == "it was flown on the air, which nobody flies again"
    assert [unpacked(shown).tick for shown in told.pictures] == [*range(0, 41, 4)]
    assert told.report is not None
    assert (told.report["success"], told.report["failure"]) == (False, "late")
    assert told.report["time_s"] > 0
