"""Many flights: the right seeds, honest figures, and nothing lost when it is stopped."""

import json
import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from statistics import NormalDist

import numpy as np
import psutil
import pytest

from agent.policy import PolicyError
from protocols.mission.document import Mission, MissionError
from protocols.wire.status import SWAP_COUNTS
from rsc_swarm.flight.simulate import simulate
from rsc_swarm.show.evaluation import render
from rsc_swarm.show.render import plain
from rsc_swarm.study import workers as crew
from rsc_swarm.study.evaluate import (
    Evaluation,
    Watcher,
    evaluate,
    seeds_of,
    summarise,
)
from rsc_swarm.study.fingerprint import fingerprint
from rsc_swarm.study.finished import journal_path
from rsc_swarm.study.intervals import clustered, failure_bound, wilson
from rsc_swarm.study.machines import Crew
from rsc_swarm.study.workers import Flight, WorkerError, fly_all, fly_batch
from tests.models import straight_on, written
from world.field import FieldError
from world.invariants import Watched
from world.outcome import Outcome

SHORT = Mission(agents=4, fly_s=0.5)
SEEDS = seeds_of(1_000_000, 3, 2)


class Stopping(Watcher):
    """Presses Ctrl-C after so many flights."""

    def __init__(self, after: int) -> None:
        self.after, self.flown, self.known = after, 0, -1

    def begin(self, known: list[Flight], missing: int) -> None:
        self.known = len(known)

    def flight(self, flight: Flight) -> None:
        self.flown += 1
        if self.flown == self.after:
            raise KeyboardInterrupt


def test_the_seeds_of_a_run_can_be_told_without_flying_it():
    assert seeds_of(5, 2, 3) == [(5, 5000), (5, 5001), (5, 5002), (6, 6000), (6, 6001), (6, 6002)]
    assert len(set(seeds_of(0, 200, 3))) == 600


@pytest.mark.parametrize(
    ("base", "maps", "starts", "complaint"),
    [
        (0, 0, 1, "--maps: give at least 1"),
        (0, 1, 1001, "--starts: give 1 to 1000"),
        (4_294_967, 1, 1, "--seed-base: map seeds end at 4294966"),
        (-1, 1, 1, "--seed-base"),
    ],
)
def test_seeds_that_do_not_exist_are_refused(base, maps, starts, complaint):
    with pytest.raises(MissionError, match=complaint):
        seeds_of(base, maps, starts)


def test_flights_on_one_map_count_as_what_they_are_together():
    """Five of 100 maps fail: whether three starts fail together or one of them is no failure of fifteen maps."""
    maps = [place for place in range(100) for _ in range(3)]
    together = [place >= 5 for place in maps]
    apart = [not (start == 0 and place < 15) for place in range(100) for start in range(3)]
    assert sum(together) == sum(apart)
    (low, high), (narrow_low, narrow_high) = clustered(together, maps), clustered(apart, maps)
    assert low < narrow_low < 0.95 < narrow_high < high
    assert (low, high) == pytest.approx(wilson(95, 100), abs=0.02)
    assert clustered(together, maps) == (low, high), "the same draws every time"


def test_one_flight_a_map_or_all_alike_has_wilsons_interval_of_so_many_maps():
    assert clustered([True] * 8 + [False] * 2, range(10)) == wilson(8, 10)
    assert clustered([True] * 600, [place // 3 for place in range(600)]) == wilson(200, 200)
    assert clustered([False] * 6, [0, 0, 0, 1, 1, 1]) == wilson(0, 2)
    assert clustered([True, False, True], [7, 7, 7]) == wilson(2, 3), "of starts on this map"


def test_the_wilson_interval_is_the_textbooks():
    assert wilson(0, 10) == pytest.approx((0.0, 0.2775), abs=1e-4)
    assert wilson(8, 10) == pytest.approx((0.4902, 0.9433), abs=1e-4)
    assert wilson(600, 600) == pytest.approx((0.99364, 1.0), abs=1e-5)


@pytest.mark.parametrize(("successes", "runs"), [(0, 7), (1, 7), (5, 7), (7, 7), (583, 600), (2999, 3000)])
def test_the_ends_of_the_wilson_interval_are_just_not_rejected(successes, runs):
    """It is made of all rates that the score test at 5 % does not reject; here they are tried one by one."""
    rates = np.linspace(0, 1, 200_001)
    z = NormalDist().inv_cdf(0.975)
    believed = rates[np.abs(successes / runs - rates) <= z * np.sqrt(rates * (1 - rates) / runs) + 1e-12]
    assert wilson(successes, runs) == pytest.approx((believed[0], believed[-1]), abs=1e-5)


def test_no_failure_in_few_runs_says_little():
    assert failure_bound(1) == pytest.approx(0.95)
    assert failure_bound(3000) == pytest.approx(0.001, abs=1e-5)


def test_a_flight_of_a_batch_is_the_flight_alone():
    mission = Mission(agents=9, start={"scrambled": True}, fly_s=2.0)
    batch = {flight.seed: flight for flight in fly_batch(mission, SEEDS) if isinstance(flight, Flight)}
    assert len(batch) == len(SEEDS)
    for map_seed, seed in SEEDS[:3]:
        alone = simulate([mission.model_copy(update={"map_seed": map_seed, "seed": seed})])
        assert batch[seed].outcome == alone[0]
    assert sum(flight.swaps["committed"] for flight in batch.values()) > 0


def test_a_policy_of_ones_own_flies_in_an_evaluation_as_it_does_alone(tmp_path):
    """Be it that it remembers by drone, and looks at the seed."""
    (tmp_path / "homing.py").write_text(
        "import numpy as np\n"
        "class Homing:\n"
        "    def __init__(self, mission):\n"
        "        self.gain = 1 + mission.seed % 7\n"
        "        self.last = np.zeros((mission.agents, 2))\n"
        "    def act(self, seen):\n"
        "        wanted = self.gain * (seen.slot_error - self.last[seen.me])\n"
        "        self.last[seen.me] = seen.velocity\n"
        "        return wanted\n"
    )
    mission = SHORT.model_copy(update={"policy": f"{tmp_path}/homing.py:Homing"})
    for flight in fly_all(mission, SEEDS[:3], 1):
        if isinstance(flight, Flight):
            alone = mission.model_copy(update={"map_seed": flight.map_seed, "seed": flight.seed})
            assert flight.outcome == simulate([alone])[0]


def test_workers_fly_every_seed_once_and_alike(tmp_path):
    one, two = evaluate(SHORT, SEEDS, Crew(1)), evaluate(SHORT, SEEDS, Crew(2))
    assert [(flight.map_seed, flight.seed) for flight in one] == SEEDS
    assert one == two


def test_any_executor_can_stand_in_for_the_processes():
    with ThreadPoolExecutor(1) as pool:
        assert evaluate(SHORT, SEEDS, Crew(2, pool)) == evaluate(SHORT, SEEDS, Crew(1))


def test_a_stopped_evaluation_goes_on_where_it_was(tmp_path, monkeypatch):
    monkeypatch.setattr("rsc_swarm.flight.simulate.ROWS", 4)  # one flight per batch
    path = tmp_path / "journal.jsonl"
    stopped, resumed = Stopping(after=3), Stopping(after=-1)
    with pytest.raises(KeyboardInterrupt):
        evaluate(SHORT, SEEDS, Crew(2), path, stopped)
    with path.open("a") as file:
        file.write('{"map_seed": 1000002, "se')  # cut off in mid-line
    flights = evaluate(SHORT, SEEDS, Crew(2), path, resumed)
    assert (resumed.known, resumed.flown) == (3, 3)
    assert flights == evaluate(SHORT, SEEDS, Crew(1))
    assert evaluate(SHORT, SEEDS, Crew(2), path, Stopping(after=1)) == flights  # nothing was left to fly


def test_the_expert_is_evaluated_like_any_other(tmp_path):
    mission = Mission(agents=4, policy="expert")
    path = tmp_path / "journal.jsonl"
    flights = evaluate(mission, SEEDS, Crew(2), path)
    assert [(flight.map_seed, flight.seed) for flight in flights] == SEEDS
    assert evaluate(mission, SEEDS, Crew(1), path, Stopping(after=1)) == flights  # nothing was left to fly
    result = summarise(mission, flights, 2, fingerprint(mission))
    assert (result.success_rate, result.breaches, result.disagreed) == (1, 0, 0)
    with pytest.raises(MissionError, match="faults: the batch simulation has none"):
        evaluate(mission.model_copy(update={"faults": ({"at_s": 1, "kind": "heal"},)}), SEEDS, Crew(1))


def test_a_journal_is_named_after_all_that_decides_a_flight(tmp_path):
    path = journal_path(tmp_path / "table.json", fingerprint(SHORT))
    assert path.parent == tmp_path
    assert path.name.startswith("table.")
    same = SHORT.model_copy(update={"map_seed": 7, "seed": 8, "name": "renamed"})
    other = SHORT.model_copy(update={"aim": "chain"})
    assert journal_path(tmp_path / "table.json", fingerprint(same)) == path
    assert journal_path(tmp_path / "table.json", fingerprint(other)) != path


def test_a_policy_from_elsewhere_decides_too(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    source = tmp_path / "my_policy.py"
    source.write_text(
        "class Mine:\n"
        "    def __init__(self, mission): pass\n"
        "    def act(self, seen): return seen.slot_error\n"
    )
    mission = SHORT.model_copy(update={"policy": "my_policy:Mine"})
    before = fingerprint(mission)
    source.write_text(source.read_text() + "# tuned\n")
    assert fingerprint(mission) != before


def test_a_journal_is_of_one_model_file(tmp_path):
    path = written(tmp_path / "mine.onnx", 4, straight_on(4))
    mission = SHORT.model_copy(update={"policy": str(path)})
    before, others = fingerprint(mission), fingerprint(SHORT)
    written(path, 4, straight_on(4, acceleration=(1.0, 0.0)))
    assert fingerprint(mission) != before
    assert fingerprint(SHORT) == others


def test_a_dead_worker_is_an_error_and_not_a_silence(monkeypatch):
    def die(mission: Mission, seeds: object) -> object:
        os.kill(os.getpid(), signal.SIGKILL)

    monkeypatch.setattr(crew, "fly_batch", die)
    with pytest.raises(WorkerError, match="a worker died; run it again to go on"):
        list(fly_all(SHORT, SEEDS, 1))


def test_workers_leave_in_mid_flight_when_nobody_listens_any_more():
    def children() -> int:
        return len(psutil.Process().children())

    before, begin = children(), time.monotonic()
    long = SHORT.model_copy(update={"fly_s": 3600.0, "policy": "cruise", "goal_x_m": 1e6})
    flying = fly_all(long, SEEDS, 2)
    assert isinstance(next(flying), int)
    assert children() == before + 2
    flying.close()
    assert children() == before
    assert time.monotonic() - begin < 60


def test_workers_in_a_policy_that_does_not_return_are_ended(tmp_path):
    """The flight with the higher seed goes wrong, the other would never end."""
    (tmp_path / "homing.py").write_text(
        "class Homing:\n"
        "    def __init__(self, mission):\n"
        f"        self.loops = mission.seed == {SEEDS[0][1]}\n"
        "    def act(self, seen):\n"
        "        while self.loops and seen.tick == 9: pass\n"
        "        assert seen.tick < 9\n"
        "        return seen.slot_error\n"
    )
    policy = f"{tmp_path}/homing.py:Homing"
    before = set(psutil.Process().children())  # of other tests
    with pytest.raises(PolicyError, match=r"raised AssertionError at .*homing.py:6 \(act\)"):
        list(fly_all(SHORT.model_copy(update={"policy": policy}), SEEDS[:2], 2))
    assert set(psutil.Process().children()) <= before


def test_a_map_without_room_is_named():
    around_the_start = {"count": (0, 3), "x_m": (-4, 4), "y_m": (-4, 4)}
    mission = Mission(agents=1, start={"radius_m": 0.0}, obstacles=around_the_start, fly_s=0.1)
    assert len(evaluate(mission, [(2, 2000)], Crew(1))) == 1
    with pytest.raises(FieldError, match="map 0, seed 0: agent 0 finds no free place"):
        list(fly_all(mission, [(2, 2000), (0, 0)], 1))


def test_the_figures_add_up():
    flights = evaluate(SHORT, SEEDS, Crew(2))
    result = summarise(SHORT, flights, 2, "code")
    assert (result.runs, result.success_rate, result.collision_rate, result.noncollision_rate) == (6, 0, 0, 1)
    assert result.tau_mean_s is None
    assert result.held_rate is None
    assert result.maps == (1_000_000, 1_000_002)
    assert [(failed.map, failed.seed) for failed in result.failures] == SEEDS
    assert result.failures[0].detail.startswith("not in formation beyond the goal line within 0.50 s")
    assert Evaluation.model_validate_json(result.model_dump_json()) == result
    assert json.loads(result.model_dump_json())["swaps_per_flight"]["committed"] >= 0


def test_success_is_measured_over_successes():
    mission = Mission(agents=1, hold_s=0.5, start={"radius_m": 1.0})
    flights = evaluate(mission, seeds_of(0, 4, 1), Crew(2))
    result = summarise(mission, flights, 1, "code")
    assert result.success_rate == result.held_rate == 1
    assert result.tau_mean_s == pytest.approx(sum(flight.outcome.tau_s or 0 for flight in flights) / 4)
    assert result.min_distance_m == min(flight.outcome.min_distance_m for flight in flights)
    row = plain(render(result)).splitlines()
    assert row[0].startswith("| mission | N | policy | runs | S % |")
    assert row[2].startswith("| plain | 1 | rsc-h20 | 4 | 100.0 | 51.0-100.0 | 100.0 | 0.0 | 0.0 |")
    assert row[0].endswith("| held % |")


def test_each_figure_is_over_the_flights_it_is_said_to_be_over():
    failed = Outcome(False, "late", 1200, None, None, 0.01, 9.0, 1.5, "", None, 0.0, (), "a")
    won = replace(
        failed, success=True, failure=None, tau_s=12.0, formed_s=11.0, max_slot_error_m=0.2,
        paper_tau_s=12.0, strict_tau_s=12.0, stood_on=True, agreed_at_success=True,
    )  # fmt: skip
    slow = replace(
        won, tau_s=14.0, formed_s=13.0, max_slot_error_m=0.4, min_distance_m=1.0, strict_tau_s=None, stood_on=False
    )  # fmt: skip
    hit = replace(failed, failure="collision", formed_s=9.0, min_distance_m=0.4)
    late = failed
    quick = Watched(None, 0.1, 0.5, 0.25, True, 1, 0)
    delays = (
        quick,
        replace(quick, agreed_after_s=2.0),
        quick,
        replace(quick, agreed_after_s=None, agreed=False),
    )
    flights = [
        Flight(0, seed, outcome, watched, {**dict.fromkeys(SWAP_COUNTS, 0), "committed": seed})
        for seed, (outcome, watched) in enumerate(zip((won, slow, hit, late), delays, strict=True))
    ]
    result = summarise(SHORT, flights, 4, "code")
    assert (result.success_rate, result.collision_rate, result.noncollision_rate) == (0.5, 0.25, 0.25)
    assert result.success_interval == pytest.approx((0.150039, 0.849961), abs=1e-6)
    assert (result.paper_rate, result.strict_rate, result.stood_on_rate) == (0.5, 0.25, 0.25)
    assert result.agreed_at_success_rate == 0.5
    assert (result.tau_mean_s, result.tau_max_s) == (13.0, 14.0)
    assert result.formed_mean_s == 11.0, "of the three that stood once"
    assert result.slot_error_max_m == 0.4, "of successes"
    assert (result.min_distance_m, result.min_distance_mean_m) == (0.4, pytest.approx(1.1)), "of all runs"
    assert (result.agreed_in_1s_rate, result.agreed_after_max_s) == (0.5, 2.0)
    assert (result.allowed_in_1s_rate, result.allowed_after_max_s) == (1.0, 0.25)
    assert (result.disagreed, result.swaps_per_flight["committed"]) == (1, 1.5)
    assert [(failed.seed, failed.failure) for failed in result.failures] == [(2, "collision"), (3, "late")]
