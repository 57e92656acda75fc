"""The strict success: near one's slot, of one mind, and for two seconds; and that it is judged beside the paper's."""

from dataclasses import replace

import numpy as np
import pytest

from protocols.mission.document import parse_mission
from world.outcome import Judgement, Outcome, as_broken
from world.referee import Verdict

THERE = Verdict(
    closest_agents_m=5.0,
    edge_error=0.01,
    slot_error_m=0.2,
    complete=True,
    passed=True,
    standing=True,
    formed=True,
)
AWAY = THERE._replace(passed=False, formed=False)
WIDE = THERE._replace(slot_error_m=1.0)
HIT = THERE._replace(closest_agents_m=0.4, agent_a=0, agent_b=1, collided=True)
LAST = 2100  # ticks


def flown(
    *spells: tuple[Verdict, int] | tuple[Verdict, int, bool], **fields: object
) -> tuple[Judgement, int]:
    """The judgement of a flight in which the referee says this for so many ticks each, and on whether all agree; and its end."""
    judgement = Judgement(parse_mission({"agents": 4, **fields}))
    return fed(judgement, *spells)


def fed(
    judgement: Judgement, *spells: tuple[Verdict, int] | tuple[Verdict, int, bool]
) -> tuple[Judgement, int]:
    tick = 0
    for verdict, ticks, *agreed in spells:
        for _ in range(ticks):
            if judgement.over:
                break
            tick += 1
            judgement.settle(tick, verdict, np.zeros((4, 2)), *agreed)
    return judgement, tick


def told(judgement: Judgement, tick: int) -> Outcome:
    return judgement.outcome(tick, "interrupted", np.ones(4, np.bool_))


def test_who_stands_for_two_seconds_has_both_successes_and_the_paper_s_ends_the_flight() -> None:
    judgement, tick = flown((AWAY, 9), (THERE, 1000))
    outcome = told(judgement, tick)
    assert (outcome.success, outcome.tau_s, outcome.ticks) == (True, 0.1, 10)
    assert (outcome.paper_tau_s, outcome.strict_tau_s, tick) == (0.1, 0.1, 210)
    assert (outcome.stood_on, outcome.agreed_at_success) == (True, True)


def test_who_asks_for_one_success_waits_for_no_other_and_has_the_same_flight() -> None:
    mission = parse_mission({"agents": 4})
    alone, end = fed(Judgement(mission, both=False), (AWAY, 9), (THERE, 1000))
    assert end == 10, "over as soon as it is decided"
    whole = told(*fed(Judgement(mission), (AWAY, 9), (THERE, 1000)))
    assert told(alone, end) == replace(whole, strict_tau_s=None, stood_on=None), (
        "what is not known is not said"
    )


def test_what_follows_the_decision_changes_nothing_but_the_other_success() -> None:
    short, tick = flown((AWAY, 9), (THERE, 1))
    assert (short.decision, short.over) == ("", False)
    at_once = told(short, tick)
    worse = told(*flown((AWAY, 9), (THERE, 1), (HIT._replace(shared_slots=2), 1)))
    same = ("success", "failure", "ticks", "min_distance_m", "overlap_s", "max_edge_error")
    assert [getattr(worse, name) for name in same] == [getattr(at_once, name) for name in same]
    assert (worse.strict_tau_s, worse.stood_on) == (None, False)


@pytest.mark.parametrize(
    "lacking",
    [(WIDE, 50), (THERE, 50, False), (AWAY, 50)],
    ids=["a metre from a slot", "of two minds", "out of formation"],
)
def test_two_seconds_begin_anew_after_whatever_is_lacking(lacking: tuple[Verdict, int]) -> None:
    outcome = told(*flown((THERE, 100), lacking, (THERE, 201)))
    assert (outcome.paper_tau_s, outcome.strict_tau_s) == (0.01, 1.51)
    assert outcome.stood_on is (lacking[0] is not AWAY)


def test_what_views_were_at_success_is_told() -> None:
    outcome = told(*flown((THERE, 5, False), (THERE, 300)))
    assert (outcome.agreed_at_success, outcome.strict_tau_s) == (False, 0.06)


def test_the_strict_success_must_begin_within_the_time_limit_and_may_be_kept_beyond_it() -> None:
    assert told(*flown((WIDE, LAST - 1), (THERE, 1000))).strict_tau_s == 21.0
    outcome = told(*flown((WIDE, LAST), (THERE, 1000)))
    assert (outcome.success, outcome.strict_tau_s) == (True, None)
    judgement, tick = flown((WIDE, LAST - 1), (THERE, 10), (WIDE, 1000))
    assert (told(judgement, tick).strict_tau_s, tick) == (None, LAST + 10)


def test_nothing_is_flown_on_for_after_a_failure() -> None:
    for spells, failure, end in (((HIT, 9),), "collision", 1), (((AWAY, 9999),), "late", LAST):
        judgement, tick = flown(*spells)
        assert (judgement.decision, tick) == (failure, end)
        assert told(judgement, tick).paper_tau_s is None


def test_a_mission_may_be_decided_by_the_strict_success() -> None:
    strict = {"success": "strict"}
    won = told(*flown((WIDE, 30), (THERE, 500), **strict))
    assert (won.success, won.tau_s, won.ticks, won.max_slot_error_m) == (True, 0.31, 231, 0.2)
    assert (won.paper_tau_s, won.strict_tau_s) == (0.01, 0.31)
    late = told(*flown((WIDE, LAST + 1), **strict))
    assert (late.success, late.failure, late.tau_s, late.ticks) == (False, "late", None, LAST)
    assert (late.paper_tau_s, late.max_slot_error_m) == (0.01, 1.0)
    hit = told(*flown((THERE, 200), (HIT, 1), **strict))
    assert (hit.failure, hit.paper_tau_s, hit.strict_tau_s) == ("collision", 0.01, None)


def test_hold_s_counts_from_the_success_that_decides() -> None:
    outcome = told(*flown((WIDE, 30), (THERE, 400), (AWAY, 1), (THERE, 400), success="strict", hold_s=5.0))
    assert (outcome.tau_s, outcome.ticks, outcome.held_after_success) == (0.31, 531, False)


def test_a_run_that_broke_has_no_success() -> None:
    judgement, tick = flown((THERE, 300))
    outcome = told(judgement, tick)
    assert outcome.successes == (True, True)
    assert as_broken(outcome, (), "permutation broken").successes == (False, False)
