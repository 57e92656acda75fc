"""Learned policies: what the model is asked and when, and that its plans are flown as they are."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agent.policy import session
from protocols.dynamics import TICK_S
from protocols.mission.document import Mission, parse_mission
from protocols.wire.frames import OBSERVATION_UNIT
from rsc_swarm.flight.simulate import Simulation, simulate
from tests import loopback
from tests.models import random_model, saved, straight_on, written

HORIZON = 10


class Notebook:
    """Stands in for a session: notes what the model is asked, and always plans to fly straight on."""

    def __init__(self) -> None:
        self.asked: list[dict[str, np.ndarray]] = []

    def run(self, outputs: list[str], inputs: dict[str, np.ndarray]) -> list[np.ndarray]:
        self.asked.append({name: value.copy() for name, value in inputs.items()})
        return [np.zeros((len(inputs["own"]), HORIZON, 2), np.float32) for _ in outputs]


@pytest.fixture
def notebook(monkeypatch: pytest.MonkeyPatch) -> Notebook:
    book = Notebook()
    monkeypatch.setattr(session, "open_session", lambda data: book)
    return book


@pytest.fixture
def model(tmp_path: Path) -> Path:
    return written(tmp_path / "still.onnx", HORIZON, straight_on(HORIZON))


def task(model: Path, **fields: Any) -> Mission:
    return parse_mission({"agents": 6, "policy": str(model), "obstacles": {"discs": []}, **fields})


def told(book: Notebook, simulation: Simulation) -> list[np.ndarray]:
    """Fly one tick; the target and history of each drone that was asked, by rising agent number."""
    before = len(book.asked)
    simulation.tick()
    return [own for question in book.asked[before:] for own in question["own"]]


# --- what is asked, and when -------------------------------------------------------------------------------


def test_all_plan_at_first_and_then_take_turns(notebook: Notebook, model: Path) -> None:
    simulation = Simulation([task(model, trajectory={"replan_ticks": 5})])
    asked = [len(told(notebook, simulation)) for _ in range(21)]
    # Of six drones two (0 and 5) have their turn when the tick is a multiple of five.
    assert asked == [6, 1, 1, 1, 1] + [2, 1, 1, 1, 1] * 3 + [2]


def test_the_model_says_how_long_a_plan_is_flown_unless_the_mission_does(
    notebook: Notebook, model: Path
) -> None:
    simulation = Simulation([task(model, agents=1)])
    assert [len(told(notebook, simulation)) for _ in range(21)] == [1] + ([0] * 9 + [1]) * 2


def test_the_model_sees_the_last_three_ticks_newest_last(notebook: Notebook, model: Path) -> None:
    simulation = Simulation([task(model, trajectory={"replan_ticks": 1})])
    seen = []
    for _ in range(5):
        own = np.array(told(notebook, simulation))
        seen.append(simulation.agents._work.observation.astype(np.float32))
        past = [seen[max(0, len(seen) - 3 + step)] for step in range(3)]
        assert np.array_equal(own, np.stack(past, axis=1)), "a history too short repeats its first entry"


def test_the_model_hears_its_neighbours_observations_one_tick_old(notebook: Notebook, model: Path) -> None:
    still = {"radius_m": 0}
    simulation = Simulation([task(model, trajectory={"replan_ticks": 1}, start=still)])
    simulation.tick()
    before = simulation.agents._work.observation.copy()
    simulation.tick()
    first, second = notebook.asked
    assert not first["heard"].any()
    assert not first["share"].any()
    near = simulation.agents._memory.hops == 1
    for row in range(6):
        neighbours = np.flatnonzero(near[row])
        heard = second["heard"][row, -1]
        assert heard[: len(neighbours)] == pytest.approx(before[neighbours], abs=1 / OBSERVATION_UNIT)
        assert not heard[len(neighbours) :].any()
        share = [1 / len(neighbours)] * len(neighbours) + [0.0] * (8 - len(neighbours))
        assert second["share"][row, -1] == pytest.approx(share)


def test_what_is_passed_on_comes_a_tick_and_a_hop_later(notebook: Notebook, tmp_path: Path) -> None:
    """Round l is the mean, over neighbours, of their round l - 1 a tick before, as the frames carried it."""
    path = written(tmp_path / "hops.onnx", HORIZON, straight_on(HORIZON), aggregation="hops")
    still = {"radius_m": 0}
    simulation = Simulation([task(path, trajectory={"replan_ticks": 1}, start=still)])
    before = np.zeros((4, 6, 18))  # rounds 0 (own) to 3
    for tick in range(5):
        simulation.tick()
        means = notebook.asked[-1]["means"][:, ::-1].swapaxes(0, 1)
        near = simulation.agents._memory.hops == 1
        expected = np.stack([near @ told / near.sum(1)[:, None] for told in before[:3]])
        assert np.allclose(means, expected, atol=3 / OBSERVATION_UNIT), tick
        before = np.concatenate([simulation.agents._work.observation[None], means])
        assert means.any() == (tick > 0)


def test_frames_that_fail_to_come_are_believed_for_a_while(notebook: Notebook, model: Path) -> None:
    radio = {"frame_rate_hz": 10, "memory_s": 0.2}
    fields = {"trajectory": {"replan_ticks": 1}, "start": {"radius_m": 0}, "radio": radio}
    simulation = Simulation([task(model, **fields)])
    for _ in range(25):
        simulation.tick()
    assert notebook.asked[-1]["share"][:, -1].sum(axis=1) == pytest.approx(np.ones(6))


def test_a_restarted_drone_plans_at_once_and_from_nothing(notebook: Notebook, model: Path) -> None:
    fault = {"at_s": 0.13, "kind": "restart", "agents": [2]}
    simulation = Simulation([task(model, faults=[fault])])
    histories = [told(notebook, simulation) for _ in range(14)]
    (fresh,) = [own for own in histories[13] if (own == own[-1]).all()]
    assert np.array_equal(fresh[-1], simulation.agents._work.observation[2].astype(np.float32))


def test_a_wide_model_gets_the_wide_view(notebook: Notebook, tmp_path: Path) -> None:
    path = tmp_path / "wide.onnx"
    saved(path, random_model(HORIZON, 8, wide=True))
    around = {"discs": [[3, 0, 1]]}
    Simulation([task(path, agents=1, obstacles=around, start={"radius_m": 0})]).tick()
    (question,) = notebook.asked
    assert question["extra"].shape == (1, 32)
    assert question["extra"][0, :3] == pytest.approx([-0.8, 0.0, 0.8])


def test_what_is_forked_after_a_rehearsal_shares_the_open_model(model: Path) -> None:
    session.open_session.cache_clear()
    Simulation([task(model)], rehearsal=True).tick()
    for _ in range(2):
        Simulation([task(model)]).tick()
    assert session.open_session.cache_info().misses == 1


def test_an_open_model_starts_no_thread_so_it_may_be_forked(model: Path) -> None:
    session.open_session.cache_clear()
    before = len(os.listdir("/proc/self/task"))
    session.open_session(model.read_bytes())
    assert len(os.listdir("/proc/self/task")) == before


# --- flying ------------------------------------------------------------------------------------------------


def speed_up(path: Path, **changes: str) -> Path:
    return written(path, HORIZON, straight_on(HORIZON, acceleration=(1.0, 0.0)), **changes)


@pytest.mark.parametrize("tracking", ["smooth", "required"])
def test_plans_are_flown_exactly(tmp_path: Path, tracking: str) -> None:
    fields = {"safety_filter": False, "trajectory": {"tracking": tracking, "replan_ticks": 7}}
    simulation = Simulation([task(speed_up(tmp_path / "push.onnx"), **fields, start={"radius_m": 0})])
    start = simulation.world.position.copy()
    for _ in range(30):
        simulation.tick()
    moved = simulation.world.position - start
    assert moved[0] == pytest.approx(np.tile([0.5 * 0.3**2, 0.0], (6, 1)), abs=1e-6)


def test_raw_plans_are_flown_by_their_points_alone(tmp_path: Path) -> None:
    path = written(
        tmp_path / "raw.onnx",
        HORIZON,
        straight_on(HORIZON, acceleration=(1.0, 0.0), told=False),
        output="raw",
    )
    simulation = Simulation([task(path, agents=1, safety_filter=False)])
    start = simulation.world.position.copy()
    for _ in range(30):
        simulation.tick()
    assert (simulation.world.position - start)[0, 0] == pytest.approx([0.5 * 0.3**2, 0.0], abs=1e-6)


def test_an_action_is_carried_out_as_it_is_every_tick(tmp_path: Path) -> None:
    body = """
        two = Constant <value_float = 2.0> ()
        middle = Constant <value_ints = [1]> ()
        ahead = Unsqueeze (target, middle)
        acceleration = Mul (ahead, two)
        displacement = Sub (ahead, ahead)
    """
    path = written(tmp_path / "action.onnx", 1, body, output="action", kind="stgnn")
    simulation = Simulation([task(path, agents=1, trajectory={"tracking": "required"})])
    for _ in range(5):
        before = simulation.world.velocity.copy()
        simulation.tick()
        target = simulation.agents._work.observation[0, :2]  # at its slot error: aim is slot
        assert (simulation.world.velocity - before)[0, 0] / TICK_S == pytest.approx(2 * target, rel=1e-5)


# --- the same in every process -----------------------------------------------------------------------------


@pytest.mark.parametrize("width", [128, 256])
def test_a_rows_plan_does_not_depend_on_the_rows_beside_it(width: int) -> None:
    """A drone asks for itself, a simulation for many at once: the bits must be the same, or twins would part.
    (Networks of ours: test_network.)"""
    run = session.open_session(random_model(20, width, wide=True).SerializeToString())
    random = np.random.default_rng(7)
    inputs = {
        tensor.name: random.normal(size=(32, *tensor.shape[1:])).astype(np.float32)
        for tensor in run.get_inputs()
    }
    whole = run.run(None, inputs)
    for size in (1, 2, 3, 5, 8, 13, 21, 31):
        for first in range(0, 32 - size + 1, size):
            part = {name: value[first : first + size] for name, value in inputs.items()}
            for some, all_ in zip(run.run(None, part), whole, strict=True):
                assert np.array_equal(some, all_[first : first + size]), (size, first)


@pytest.mark.parametrize(
    "way",
    [
        {},
        {"trajectory": {"tracking": "required"}, "safety_filter": False},
        {"radio": {"loss": 0.3, "frame_rate_hz": 20}, "aim": "chain", "sensing": {"neighbours": "heard"}},
        {"faults": [{"at_s": 0.5, "kind": "restart", "agents": [2]}], "trajectory": {"replan_ticks": 3}},
    ],
    ids=["ours", "as-in-the-paper", "poor-radio", "restart"],
)
def test_a_drone_alone_and_all_together_fly_the_same_flight(tmp_path: Path, way: dict[str, Any]) -> None:
    path = tmp_path / "random.onnx"
    saved(path, random_model(20, 32, wide=True))
    mission = task(path, fly_s=2.0, **way)
    assert loopback.fly(mission).outcome == simulate([mission])[0]


def test_the_library_starts_no_threads_and_sends_no_reports() -> None:
    count = "import os, agent.policy.session; print(len(os.listdir('/proc/self/task')))"
    alone = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    run = subprocess.run([sys.executable, "-c", count], env=alone, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "1"
