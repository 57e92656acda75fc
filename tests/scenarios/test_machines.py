"""Flights on Dask workers: the same flights, whoever flies them, and whoever dies meanwhile."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from protocols.mission.document import Mission, MissionError
from rsc_swarm.study import machines, workers
from rsc_swarm.study.evaluate import Watcher, evaluate, seeds_of
from rsc_swarm.study.machines import Crew, MachinesError, Who, crew_of
from rsc_swarm.study.workers import Flight, WorkerError

SHORT = Mission(agents=4, fly_s=0.5)
SEEDS = seeds_of(1_000_000, 20, 1)


class Murderer(Watcher):
    """Kills a worker as soon as somebody has flown."""

    def __init__(self, victim: "subprocess.Popen[bytes]") -> None:
        self.victim = victim

    def flight(self, flight: Flight) -> None:
        self.victim.kill()


@pytest.fixture
def dask(tmp_path_factory: pytest.TempPathFactory) -> "Iterator[tuple[str, list[subprocess.Popen[bytes]]]]":
    """A scheduler and two workers, a process each."""
    folder = tmp_path_factory.mktemp("dask")
    found, quiet = folder / "scheduler.json", {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}

    def start(what: str, *words: str) -> "subprocess.Popen[bytes]":
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{what}", "--scheduler-file", str(found), *words, "--no-dashboard"],
            cwd=folder, **quiet,
        )  # fmt: skip

    scheduler = start("scheduler", "--port", "0", "--host", "127.0.0.1")
    crew = [start("worker", "--nthreads", "1", "--no-nanny") for _ in range(2)]
    try:
        yield _address(found), crew
    finally:
        for process in (*crew, scheduler):
            process.kill()
            process.wait()


def _address(file: Path) -> str:
    for _ in range(600):
        if file.exists() and (text := file.read_text()).endswith("}"):
            return str(json.loads(text)["address"])
        time.sleep(0.1)
    raise TimeoutError(file)


def test_what_a_killed_worker_had_is_flown_by_another(
    dask: "tuple[str, list[subprocess.Popen[bytes]]]", monkeypatch: pytest.MonkeyPatch
) -> None:
    address, crew = dask
    expected = evaluate(SHORT, SEEDS, Crew(1))
    monkeypatch.setattr(workers, "TASK", 2)
    with crew_of(Who(on=address)) as there:
        flown = evaluate(SHORT, SEEDS, there, watcher=Murderer(crew[0]))
    assert crew[0].wait() != 0
    assert flown == expected

    monkeypatch.setattr(machines, "whole_fingerprint", lambda: "0" * 16)
    with pytest.raises(MachinesError, match=r"worker tcp://\S+ has other code \(\w{16}\) than this command"):  # noqa: SIM117
        with crew_of(Who(on=address)):
            pass


def test_a_training_whose_flights_others_fly_comes_to_the_same_weights(
    dask: "tuple[str, list[subprocess.Popen[bytes]]]", tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Though a worker is killed amid an epoch."""
    torch = pytest.importorskip("torch", reason="training needs the extra 'train'")
    from rsc_swarm.training import dagger
    from rsc_swarm.training.config import TrainingConfig
    from rsc_swarm.training.watcher import Nobody
    from tests.training.conftest import TINY, weights

    address, crew = dask
    config = TrainingConfig(**{**TINY, "parts": 3})
    monkeypatch.setattr(dagger, "export", lambda *_: None)

    class Murderous(Nobody):
        def step(self, share: float) -> None:
            crew[0].kill()

    dagger.train(config, tmp_path / "here", "cpu", 1, Nobody())
    with crew_of(Who(on=address)) as there:
        dagger.train(config, tmp_path / "there", "cpu", 1, Murderous(), there.executor)
    assert crew[0].wait() != 0
    for name, here in weights(tmp_path / "here").items():
        assert torch.equal(here, weights(tmp_path / "there")[name]), name


def test_a_worker_with_another_policy_of_that_name_flies_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    said = iter(["here", "there"])
    monkeypatch.setattr(workers, "fingerprint", lambda mission: next(said))
    with ThreadPoolExecutor(1) as pool, pytest.raises(WorkerError, match="has other files of policy rsc-h20"):
        evaluate(SHORT, SEEDS, Crew(1, pool))


@pytest.mark.parametrize(
    ("who", "complaint"),
    [
        (Who(0), "--workers: give at least 1, not 0"),
        (Who(2, "local:2"), "--workers: --on says who flies"),
        (Who(on="local:0"), "--on local:0: give local:4"),
        (Who(on="local"), "--on local: give local:4"),
        (Who(on="host:8786"), "--on host:8786: give local:4"),
    ],
)
def test_who_names_nobody_is_refused_in_one_line(who: Who, complaint: str) -> None:
    with pytest.raises(MissionError, match=complaint), crew_of(who):
        pass


def test_where_no_scheduler_is_one_line_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machines, "_ANSWER_S", 0.5)
    with pytest.raises(MachinesError, match=r"tcp://127.0.0.1:9: no scheduler answers there"):  # noqa: SIM117
        with crew_of(Who(on="tcp://127.0.0.1:9")):
            pass


def test_without_dask_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissionError, match=r"--on needs distributed: pip install -e '.\[dask\]'"):  # noqa: SIM117
        with crew_of(Who(on="local:1")):
            pass
