"""What a flight's report says, to programs and to people."""

import dataclasses
import io
import json
from pathlib import Path

import pytest

from protocols.mission.document import Mission
from protocols.wire.status import SWAP_COUNTS
from rsc_swarm.flight.in_process import fly
from rsc_swarm.flight.report import FlightReport, describe, describe_failure, report_of
from rsc_swarm.show.evaluation import print_notes
from rsc_swarm.show.render import console, plain, render
from rsc_swarm.show.report_schema import json_schema, markdown
from rsc_swarm.study.evaluate import summarise
from rsc_swarm.study.workers import Flight
from world.outcome import Outcome, StruckOff, as_broken

SMALL = Mission(agents=4, map_seed=2)


@pytest.fixture(scope="module")
def report() -> FlightReport:
    return report_of(fly(SMALL), SMALL, "simulate", "lockstep", "rsc-swarm simulate --agents 4 --map 2")


def ended(failure: str | None = None, **changes: object) -> Outcome:
    outcome = Outcome(
        success=failure is None,
        failure=failure,
        ticks=731,
        tau_s=7.31 if failure is None else None,
        formed_s=7.31 if failure is None else None,
        max_edge_error=0.05,
        max_slot_error_m=1.25,
        min_distance_m=0.42,
        closest="agents 3 and 7 at x = 21.3 m, y = -3.0 m, t = 7.31 s",
        held_after_success=None,
        overlap_s=0.0,
        lost_agents=(),
        digest="00",
    )
    return dataclasses.replace(outcome, **changes)


def test_a_report_survives_json(report):
    assert FlightReport.model_validate_json(report.model_dump_json()) == report
    assert json.loads(json_schema(FlightReport))["additionalProperties"] is False


def test_what_a_stranger_wrote_does_nothing_on_a_terminal(report):
    clears = "\x1b[2J"
    theirs = report.model_copy(
        update={"detail": f"all well{clears}", "closest": clears, "again": f"run\n{clears}"}
    )
    read = FlightReport.model_validate_json(theirs.model_dump_json())
    assert (read.detail, read.closest, read.again) == (r"all well\x1b[2J", r"\x1b[2J", r"run\n\x1b[2J")


def test_it_adds_up(report):
    frames = report.frames
    assert report.success
    assert report.tau_s == report.time_s == report.ticks / 100
    assert frames.sent == 4 * report.ticks
    assert 50 < frames.median_bytes < 300
    assert frames.sent_bytes / frames.sent == pytest.approx(frames.median_bytes, rel=0.2)
    assert sum(frames.dropped.model_dump().values()) == sum(frames.rejected.values()) == 0
    assert report.watch.breach is None
    assert report.mission["agents"] == 4


def test_what_is_dropped_and_swapped_is_counted():
    mission = Mission(agents=9, start={"scrambled": True}, radio={"loss": 0.3}, fly_s=3.0)
    report = report_of(fly(mission), mission, "simulate", "lockstep", "")
    assert report.failure == "late"
    assert report.frames.dropped.loss > 0.2 * report.frames.delivered
    assert report.swaps.committed > 0
    assert report.swaps.proposed >= report.swaps.committed
    text = plain(render(report))
    assert "% lost (loss " in text
    assert f"{report.swaps.proposed} proposed, {report.swaps.committed} made" in text


def test_people_read_the_verdict_first_and_how_to_fly_it_again_last(report):
    lines = plain(render(report)).splitlines()
    assert lines[0] == (
        "SUCCESS: all 4 agents in formation beyond the goal line and every obstacle "
        f"after {report.tau_s:.2f} s."
    )
    assert lines[1].startswith("Closest: agent")
    assert lines[-1] == "Fly it again:  rsc-swarm simulate --agents 4 --map 2"
    assert not any(line.endswith(" ") for line in lines)


@pytest.mark.parametrize(
    ("outcome", "sentence"),
    [
        (ended("collision"), "0.42 m between agents 3 and 7 at x = 21.3 m, y = -3.0 m, t = 7.31 s"),
        (
            ended("late", lost_agents=(2, 5, 9), max_edge_error=0.34),
            "not in formation beyond the goal line within 7.31 s: worst edge error 34%, "
            "worst slot error 1.2 m, lost agents 2, 5 and 9",
        ),
        (ended("all-lost"), "every agent was lost by t = 7.31 s"),
        (ended("interrupted"), "interrupted at t = 7.31 s: worst edge error 5%, worst slot error 1.2 m"),
    ],
)
def test_a_failure_says_who_where_and_when(outcome, sentence):
    assert describe_failure(outcome, Mission(agents=12)) == sentence


def test_a_run_that_broke_is_told_in_the_words_of_the_watch_and_is_neither_a_success_nor_a_failure():
    broken = as_broken(ended(), (), "permutation broken at tick 3")
    assert (broken.success, broken.failure, broken.rest_succeeded) == (False, "broken", True)
    assert describe(broken, Mission(), "permutation broken at tick 3") == (
        "permutation broken at tick 3. Those who were left: all 25 agents in formation beyond the goal line and every "
        "obstacle after 7.31 s"
    )


def test_whoever_was_struck_off_is_told_first_and_then_what_became_of_the_others():
    struck = tuple(StruckOff(agent, 3.2, "its process (12) was ended by SIGKILL") for agent in range(5))
    broken = as_broken(ended("late", lost_agents=(0, 1, 2, 3, 4)), struck, None)
    assert (broken.rest_succeeded, broken.rest_failure, broken.struck_off) == (False, "late", struck)
    text = describe(broken, Mission(agents=12))
    assert text.startswith(
        "agent 0 was lost at t = 3.20 s without the mission's doing: its process (12) was ended"
    )
    assert "agent 3 was lost" not in text
    assert "; and 2 more. Those who were left: not in formation" in text


def test_nothing_breaks_a_flight_that_was_stopped():
    stopped = as_broken(ended("interrupted"), (StruckOff(3, 1.0, "shot"),), None)
    assert (stopped.failure, stopped.struck_off) == ("interrupted", (StruckOff(3, 1.0, "shot"),))


def test_a_success_says_who_is_missing_and_whether_it_held():
    mission = Mission(agents=9, hold_s=2.0)
    assert describe(ended(lost_agents=(3,), held_after_success=False), mission) == (
        "the 8 agents left of 9 in formation beyond the goal line and every obstacle after 7.31 s "
        "but did not hold it for 2 s more"
    )


def test_a_fault_that_did_not_happen_is_told():
    """It was due after the flight had succeeded, which nobody can know beforehand: what survived it did not meet it."""
    faults = [{"at_s": 0, "kind": "slow", "agents": [1]}, {"at_s": 20, "kind": "kill", "agents": [0]}]
    mission = Mission(agents=2, obstacles=EMPTY, faults=faults)
    flown = fly(mission)
    report = report_of(flown, mission, "simulate", "lockstep", "")
    assert (report.success, report.missed_faults) == (True, (1,))
    (line,) = [line for line in plain(render(report)).splitlines() if line.startswith("did not happen")]
    assert line.endswith("  kill at 20 s (the flight was over)")
    row = summarise(
        mission, [Flight(0, 0, flown.outcome, flown.watched, dict.fromkeys(SWAP_COUNTS, 0))], 1, ""
    )
    print_notes(console(text := io.StringIO()), row, 1.0, str)
    assert row.missed_faults == 1
    assert "1 of 1 flights were over before all faults" in text.getvalue()


EMPTY = {"discs": []}


@pytest.mark.parametrize(
    ("fields", "outcome", "sentence"),
    [
        ({"agents": 1, "obstacles": EMPTY}, ended(), "the agent beyond the goal line after 7.31 s"),
        ({"agents": 1}, ended(), "the agent beyond the goal line and every obstacle after 7.31 s"),
        ({"agents": 2, "obstacles": {"count": [0, 0]}}, ended(), "both agents in formation beyond the goal line after 7.31 s"),
        ({"agents": 3}, ended(lost_agents=(0, 2)), "the 1 agent left of 3 beyond the goal line and every obstacle after 7.31 s"),
        ({"agents": 1}, ended("late"), "not beyond the goal line within 7.31 s: slot error 1.2 m"),
        ({"agents": 1}, ended("all-lost"), "the agent was lost by t = 7.31 s"),
    ],
)  # fmt: skip
def test_a_swarm_of_few_is_told_as_one_would_say_it(fields, outcome, sentence):
    assert describe(outcome, Mission(**fields)) == sentence


def test_of_one_drone_nothing_is_told_that_takes_two():
    mission = Mission(agents=1, obstacles=EMPTY, fly_s=0.01)
    text = plain(render(report_of(fly(mission), mission, "simulate", "lockstep", "again")))
    assert not any(
        word in text for word in ("Closest", "edge", "swaps", "heard", "formation", "inf", " 0.0 x")
    )


def test_no_swaps_are_none():
    mission = Mission(agents=2, swap={"rule": "off"}, fly_s=0.05)
    rows = plain(render(report_of(fly(mission), mission, "simulate", "lockstep", "again"))).splitlines()
    assert [row.split()[1:] for row in rows if row.startswith("swaps")] == [["none"]]


def test_the_document_is_up_to_date():
    document = Path(__file__).parents[2] / "docs" / "report.md"
    assert document.read_text() == markdown(), "run: rsc-swarm schema --markdown > docs/report.md"


def test_no_field_is_left_unexplained():
    rows = [row for row in markdown().splitlines() if row.startswith("| `")]
    assert len(rows) > 80
    assert not [row for row in rows if row.endswith("|  |")]
