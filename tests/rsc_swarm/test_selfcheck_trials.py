"""A selfcheck goes on where it was stopped: what was flown is not flown again."""

from itertools import islice
from pathlib import Path

import pytest

from protocols.mission.document import Mission
from rsc_swarm.selfcheck import trials
from rsc_swarm.selfcheck.trials import FinishedTrials, _Flight
from world.outcome import Outcome

ENDED = Outcome(True, None, 1300, 13.0, 2.0, 0.01, 0.1, 1.0, "", None, 0.0, (), "d")
MISSIONS = [Mission(agents=4, map_seed=seed) for seed in (0, 1)]
NAMES = ["hellos", "late"]


def test_a_stopped_check_goes_on(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    flown: list[tuple[int, str | None]] = []

    def fly(mission: Mission, attack: str | None, turned: int, seed: int) -> _Flight:
        flown.append((mission.map_seed, attack))
        return _Flight(ENDED, ENDED, 10.0, 100.0)

    monkeypatch.setattr(trials, "_fly", fly)
    whole = list(trials.trials(MISSIONS, NAMES, 3, 0))
    flown.clear()
    with FinishedTrials(tmp_path / "journal") as book:
        begun = list(islice(trials.trials(MISSIONS, NAMES, 3, 0, book), 3))
    with (tmp_path / "journal").open("a") as journal:
        journal.write('{"attack": "la')  # cut off in mid-line
    with FinishedTrials(tmp_path / "journal") as book:
        assert list(trials.trials(MISSIONS, NAMES, 3, 0, book)) == whole
    assert begun == whole[:3]
    assert flown == [(0, None), (0, "hellos"), (0, "late"), (1, None), (1, "hellos"), (1, None), (1, "late")]
