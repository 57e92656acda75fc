"""What a campaign draws stays within its budget, can be flown, and is the same every time."""

from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis.internal.conjecture.providers import Constants, _get_local_constants

from protocols.mission.document import Mission, MissionError
from rsc_swarm.campaign.budget import TROUBLES, Budget, parse_budget, ready
from rsc_swarm.campaign.flying import Plan, drawn
from rsc_swarm.campaign.strategies import missions

NINE = Mission(agents=9)
HARSH = Budget(kill=2, freeze=2, hang=2, restart=2, part=2, slow=2, lie=2, burst=0.6)


@settings(max_examples=60, deadline=None)
@given(missions(NINE, HARSH, 7))
def test_no_more_goes_wrong_than_the_budget_says(mission: Mission) -> None:
    kinds = Counter(fault.kind for fault in mission.faults)
    assert kinds["kill"] <= 2
    assert kinds["freeze"] == kinds["thaw"] + kinds["restart"] - _plain_restarts(mission) <= 4
    assert kinds["part"] == kinds["heal"] <= 2
    assert kinds["slow"] == kinds["recover"] <= 2
    assert kinds["lie"] == kinds["truth"] <= 2
    assert kinds["loss"] <= 2
    spells = [fault.loss for fault in mission.faults if fault.kind == "loss"]
    assert all(mission.radio.loss <= loss <= HARSH.spell_loss for loss in spells)
    assert all(fault.at_s <= HARSH.last_s for fault in mission.faults)
    assert all(fault.factor >= HARSH.slow_factor for fault in mission.faults if fault.kind == "slow")
    assert mission.radio.burst.loss <= 0.6
    assert mission.radio.delay_ms <= HARSH.delay_ms
    assert Mission.model_validate_json(mission.model_dump_json()) == mission


def _plain_restarts(mission: Mission) -> int:
    """Restarts of drones that did not hang."""
    hung, plain = set(), 0
    for fault in mission.faults:
        if fault.kind == "freeze":
            hung.update(fault.agents)
        elif fault.kind in ("thaw", "restart"):
            plain += fault.kind == "restart" and not hung.intersection(fault.agents)
            hung.difference_update(fault.agents)
    return plain


def test_a_task_is_the_same_whenever_it_is_drawn() -> None:
    plan = Plan(NINE, HARSH, seed=3, flights=100)
    assert (plan.tasks, plan.size(0), plan.size(1)) == (2, 64, 36)
    assert drawn(plan, 1) == drawn(plan, 1)
    assert len(drawn(plan, 1)) == 36
    assert drawn(plan, 0)[0].faults == (), "Hypothesis begins with the simplest"
    assert drawn(plan, 0) != drawn(Plan(NINE, HARSH, seed=4, flights=100), 0)


def test_what_is_drawn_depends_on_the_seed_and_not_on_the_code_that_happens_to_be_loaded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[None] = []

    def numbers() -> Constants:
        """Those in the sources of loaded modules, for which Hypothesis asks."""
        asked.append(None)
        return _get_local_constants()

    monkeypatch.setattr("hypothesis.internal.conjecture.providers._get_local_constants", numbers)
    _drawn_by_hypothesis()
    assert asked
    asked.clear()
    drawn(Plan(NINE, HARSH, 3, 64), 0)
    assert not asked


@settings(database=None, max_examples=100)
@given(missions(NINE, HARSH, 7))
def _drawn_by_hypothesis(_: Mission) -> None:
    """As it draws itself."""


def test_every_kind_of_trouble_comes_and_the_mission_keeps_its_own() -> None:
    mission = Mission(agents=9, faults=[{"at_s": 3, "kind": "kill", "slots": [8]}])
    all_drawn = drawn(Plan(mission, HARSH, 0, 64), 0)
    kinds = Counter(fault.kind for mission in all_drawn for fault in mission.faults)
    assert set(kinds) == {
        "kill",
        "freeze",
        "thaw",
        "restart",
        "part",
        "heal",
        "slow",
        "recover",
        "loss",
        "lie",
        "truth",
    }
    assert all(mission.faults[0] in one.faults for one in all_drawn)


def test_a_budget_is_read_as_it_is_written() -> None:
    assert parse_budget(None) == parse_budget(str(Budget())) == Budget()
    assert parse_budget("kill=2,burst=0.5") == Budget(kill=2, burst=0.5)
    nothing = parse_budget("none,restart=3")
    assert [getattr(nothing, kind) for kind in TROUBLES] == [0, 0, 0, 3, 0, 0, 0, 0]
    assert nothing.loss == nothing.delay_ms == 0
    assert nothing.last_s == nothing.until_s, "nothing else lasts"


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("kills=1", "--budget kills=1: write NAME=NUMBER, where NAME is one of kill,"),
        ("kill", "--budget kill: give a whole number from 0 to 20"),
        ("kill=1.5", "--budget kill=1.5: give a whole number"),
        ("kill=-1", "--budget kill=-1: give a whole number"),
        ("burst=nan", "--budget burst=nan: give a number from 0 to 1"),
        ("burst=2", "--budget burst=2: give a number from 0 to 1"),
        ("slow_factor=0", "--budget slow_factor=0: give a number from 0.01 to 0.99"),
        ("slow_factor=1", "--budget slow_factor=1: give a number from 0.01 to 0.99"),
        ("spell_loss=0.004", "--budget spell_loss=0.004: give a number from 0.01 to 1"),
        ("", None),
    ],
)
def test_a_wrong_budget_is_one_line(text: str, complaint: str | None) -> None:
    if complaint is None:
        assert parse_budget(text) == Budget()
        return
    with pytest.raises(MissionError, match=complaint):
        parse_budget(text)


def test_a_campaign_leaves_somebody_alive_and_time_for_all() -> None:
    with pytest.raises(MissionError, match="--budget kill=9: leaves none of 9 drones"):
        ready(NINE, Budget(kill=9))
    assert ready(NINE, Budget()).limit_ticks == NINE.limit_ticks + 1100
