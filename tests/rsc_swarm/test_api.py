"""The public door: what a program gets from ``import rsc_swarm as rs``."""

import json
import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import rsc_swarm as rs
from rsc_swarm.api import _settings
from rsc_swarm.options import MissionOptions, resolve
from world.outlets.trajectory import TrajectoryError

ROOT = Path(__file__).parents[2]
SHORT = {"agents": 4, "fly_s": 1.0}


class Still:
    """Wants nothing."""

    def __init__(self, mission: rs.Mission) -> None:
        self.mission = mission

    def act(self, seen: rs.Seen) -> np.ndarray:
        return np.zeros((len(seen.me), 2))


class Bored(Still):
    """Somebody presses Ctrl-C while it is asked."""

    def act(self, seen: rs.Seen) -> np.ndarray:
        if seen.tick == 3:
            signal.raise_signal(signal.SIGINT)
        return super().act(seen)


def test_ctrl_c_leaves_flights_as_it_leaves_whatever_python_does():
    for missions in (rs.mission(policy=Bored), [rs.mission(policy=Bored, seed=seed) for seed in range(2)]):
        with pytest.raises(KeyboardInterrupt):
            rs.simulate(missions)


def test_the_door_opens_only_when_somebody_comes():
    code = "import sys, rsc_swarm; print('numpy' in sys.modules); rsc_swarm.mission; print('numpy' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False", "True"]


def test_what_is_not_offered_is_not_there():
    with pytest.raises(AttributeError, match="module 'rsc_swarm' has no attribute 'fly_all'"):
        _ = rs.fly_all  # type: ignore[attr-defined]


def test_a_mission_is_a_file_or_a_name_with_fields_on_top(tmp_path):
    assert rs.mission() == rs.Mission()
    file = tmp_path / "mine.yaml"
    file.write_text("agents: 9\nradio: {loss: 0.1, hops: 2}\n")
    mine = rs.mission(file, map_seed=3, radio={"loss": 0.2})
    assert (mine.agents, mine.map_seed, mine.radio.loss, mine.radio.hops) == (9, 3, 0.2, 2)
    assert rs.mission("dense").obstacles.count == (12, 14)


def test_a_mission_is_another_with_something_changed():
    mine = rs.mission(rs.mission("dense", radio={"loss": 0.1}), agents=36, radio={"hops": 2})
    assert mine == rs.mission("dense", agents=36, radio={"loss": 0.1, "hops": 2})


def test_numbers_of_numpy_are_numbers():
    fault = {"at_s": np.float64(1), "kind": "kill", "slots": np.array([0])}
    mine = rs.mission(
        agents=np.int64(4), seed=np.uint64(5), faults=[fault], obstacles={"discs": np.array([[20, 0, 1.5]])}
    )
    assert mine == rs.mission(
        agents=4,
        seed=5,
        faults=[{"at_s": 1, "kind": "kill", "slots": [0]}],
        obstacles={"discs": [[20, 0, 1.5]]},
    )


def test_a_policy_is_a_class_if_it_can_be_found_again():
    assert rs.mission(policy=Still).policy == f"{__name__}:Still"

    class Hidden(Still):
        pass

    with pytest.raises(
        rs.MissionError, match=r"Hidden cannot be found by its name; define the class at the top"
    ):
        rs.mission(policy=Hidden)


class Mute:
    """Cannot say what it is."""

    def __repr__(self) -> str:
        raise RuntimeError("mute")


@pytest.mark.parametrize(
    ("asked", "line"),
    [
        (lambda: rs.mission("nowhere"), "nowhere: no such file; shipped missions are dense"),
        (lambda: rs.mission(agents=0), "agents: "),
        (lambda: rs.mission(radio={"lost": 1}), "radio.lost: unknown field; known here: burst"),
        (lambda: rs.simulate(rs.mission(policy="nothing")), "unknown policy 'nothing'"),
        (lambda: rs.mission("plane"), "plane: no such file; is plain meant? shipped missions are dense"),
        (lambda: rs.mission(str(ROOT)), "is a folder; give a mission file"),
        (lambda: rs.mission("a" * 5000), "...: cannot be looked at (File name too long)"),
        (
            lambda: rs.mission({"agents": 4}),
            "give a file, a name or fields such as agents=25, not {'agents': 4}",
        ),
        (
            lambda: rs.mission(formation="vee"),
            "formation: write a mapping of its fields (shape, slots_m, spacing_m), not 'vee'",
        ),
        (
            lambda: rs.mission(obstacles={"discs": [[20, 0, 1.5, 0, 1]]}),
            "obstacles.discs.0: write at most 3 values, not [20",
        ),
        (lambda: rs.mission(obstacles={"discs": [[20, 0]]}), "obstacles.discs.0.2: is missing"),
        (lambda: rs.mission(obstacles={"discs": 3}), "obstacles.discs: write a list, not 3"),
        (lambda: rs.simulate("plain"), "mission: give a Mission, as rs.mission(...) makes it, not 'plain'"),
        (
            lambda: rs.simulate([rs.mission(), 3]),
            "mission: give a Mission, as rs.mission(...) makes it, not 3",
        ),
        (lambda: rs.launch("plain"), "mission: give a Mission, as rs.mission(...) makes it, not 'plain'"),
        (lambda: rs.launch(rs.mission(), "runs/1"), "clock: give 'lockstep' or 'realtime', not 'runs/1'"),
        (lambda: rs.evaluate("plain"), "mission: give a Mission, as rs.mission(...) makes it, not 'plain'"),
        (lambda: rs.evaluate(rs.mission(), maps="3"), "maps: give a whole number, not '3'"),
        (lambda: rs.evaluate(rs.mission(), seed_base=1e6), "seed_base: give a whole number, not 1000000.0"),
        (lambda: rs.evaluate(rs.mission(), on=3), "--on"),
        (
            lambda: rs.draw("x.png", []),
            "flights: give a Flight, as simulate and launch return it, not ",
        ),
        (lambda: rs.draw([], "x.png"), "flights: give at least one"),
        (lambda: rs.write_report("x.html", 3), "flight: give a Flight"),
        (lambda: rs.evaluate(rs.mission(), maps=0), "maps: give at least 1"),
        (lambda: rs.launch(rs.mission(policy="__main__:Mine")), "put the class into a module of its own"),
        (lambda: rs.launch(rs.mission(), run_dir=""), "run_dir: give a path, not ''"),
        (lambda: rs.launch(rs.mission(), run_dir=0), "run_dir: give a path, not 0"),
        (lambda: rs.draw(rs.simulate(rs.mission(**SHORT)), None), "out: give a path, not nothing"),
        (lambda: rs.draw(rs.simulate(rs.mission(**SHORT)), b"x.png"), "out: give a path, not b'x.png'"),
        (
            lambda: rs.write_report(rs.simulate(rs.mission(**SHORT)), "a\0b"),
            r"out: give a path, not 'a\x00b'",
        ),
        (lambda: rs.mission("a\x1b[2J\n.yaml"), r"a\x1b[2J .yaml: no such file"),
        (lambda: rs.mission(Mute()), "mission: give a file, a name or fields such as agents=25, not Mute"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(asked, line):
    with pytest.raises((rs.MissionError, rs.PolicyError)) as refused:
        asked()
    assert line in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_flight_is_its_report_and_its_arrays():
    flight = rs.simulate(rs.mission(**SHORT, obstacles={"discs": [[20, 0, 1.5]]}))
    path = flight.trajectory
    assert flight.report.failure == "late"
    assert path.positions.shape == path.velocities.shape == (101, 4, 2)
    assert path.slots.shape == path.flying.shape == (101, 4)
    assert path.obstacles.tolist() == [[20, 0, 1.5]]
    assert path.times[-1] == pytest.approx(1.0)
    np.testing.assert_allclose(np.diff(path.positions, axis=0) / path.tick_s, path.velocities[1:], atol=0.06)


def test_several_missions_are_flown_each_by_its_own_rules():
    first, second = rs.mission(**SHORT), rs.mission(agents=3, fly_s=0.5)
    flights = rs.simulate([first, second])
    assert [flight.report.agents for flight in flights] == [4, 3]
    assert flights[1].report.digest == rs.simulate(second).report.digest


def test_missions_that_are_flown_in_step_have_the_reports_of_flights_alone():
    """Each with its own map, start and end, whatever goes wrong on the way; the others in between are flown by themselves."""
    faults = [{"at_s": 0.5, "kind": "kill", "agents": [2]}, {"at_s": 0.8, "kind": "restart", "agents": [1]}]
    rules = {
        "agents": 6,
        "policy": "analytic",
        "radio": {"loss": 0.3},
        "faults": faults,
        "start": {"scrambled": True},
    }
    missions = [
        rs.mission(**rules, map_seed=3, seed=4),
        rs.mission(**SHORT),
        rs.mission(**rules, map_seed=5, name="another"),
        rs.mission(**rules, obstacles={"discs": [[20, 0, 1]]}),
    ]  # fmt: skip
    for flight, mission in zip(rs.simulate(missions), missions, strict=True):
        alone = rs.simulate(mission)
        told, expected = (
            one.report.model_dump(exclude={"wall_s", "real_time_factor"}) for one in (flight, alone)
        )
        assert told == expected
        np.testing.assert_array_equal(flight.trajectory.positions, alone.trajectory.positions)
        np.testing.assert_array_equal(flight.trajectory.obstacles, alone.trajectory.obstacles)


def test_the_command_that_flies_it_again_makes_the_same_mission():
    mission = rs.mission(
        "restart", agents=9, name="123", radio={"burst": {"loss": 0.1 + 0.2}}, swap={"rule": "off"}, fly_s=1e-2
    )  # fmt: skip
    words = _settings(mission)
    assert words[::2] == ["--set"] * (len(words) // 2)
    assert resolve(MissionOptions(set=words[1::2])) == mission
    again = shlex.split(rs.simulate(mission).report.again)
    assert again == ["rsc-swarm", "simulate", *words]


def test_the_command_finds_a_class_of_ones_own_module_in_any_folder(tmp_path):
    flight = rs.simulate(rs.mission(policy=Still, **SHORT))
    words = shlex.split(flight.report.again)[1:]
    again = [sys.executable, "-m", "rsc_swarm", *words, "--json", "-"]
    run = subprocess.run(
        again, cwd=tmp_path, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)}
    )
    assert json.loads(run.stdout)["digest"] == flight.report.digest, run.stderr


def test_an_evaluation_has_its_interval():
    row = rs.evaluate(rs.mission(**SHORT), maps=2, starts=1, seed_base=1_000_000, workers=1)
    assert (row.runs, row.success_rate, row.maps) == (2, 0.0, (1_000_000, 1_000_001))
    low, high = row.success_interval
    assert low == 0.0 < high < 1.0


def test_what_is_no_recorded_flight_is_refused_in_one_line(tmp_path):
    flight = rs.simulate(rs.mission(**SHORT))
    kept = tmp_path / "trajectory.npz"
    flight.trajectory.save(kept)
    np.testing.assert_array_equal(rs.Trajectory.load(kept).positions, flight.trajectory.positions)
    whole = kept.read_bytes()
    for content in (b"", b"no flight", whole[: len(whole) // 2]):
        kept.write_bytes(content)
        with pytest.raises(TrajectoryError, match=r"trajectory.npz: is not a recorded flight \(.+\)"):
            rs.Trajectory.load(kept)
    np.savez(kept, positions=np.zeros((1, 1, 2)))
    with pytest.raises(TrajectoryError, match=r"is not a recorded flight \(.*no item named"):
        rs.Trajectory.load(kept)
    with pytest.raises(TrajectoryError, match="No such file"):
        rs.Trajectory.load(tmp_path / "nowhere.npz")


def test_a_flight_is_drawn(tmp_path):
    pytest.importorskip("matplotlib")
    flight = rs.simulate(rs.mission(**SHORT))
    rs.draw([flight, flight], tmp_path / "two.svg")
    assert (tmp_path / "two.svg").stat().st_size > 1000


def test_a_swarm_of_more_drones_than_a_byte_can_name_swaps_and_agrees():
    mission = rs.mission(agents=300, policy="analytic", fly_s=0.15, obstacles={"discs": []})
    report = rs.simulate(mission).report
    assert (report.agents, report.watch.breach) == (300, None)
    assert report.swaps.committed > 0


def test_missions_may_come_in_an_array():
    mission = rs.mission(**SHORT)
    for array in (np.array(mission, dtype=object), np.array([mission], dtype=object)):
        flown = rs.simulate(array)
        assert [flight.report.digest for flight in flown] == [rs.simulate(mission).report.digest]
