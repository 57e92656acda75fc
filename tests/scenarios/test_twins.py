"""Twins: a flight in real processes is, bit for bit, the flight of the same mission in one process."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from protocols.mission.document import parse_mission
from rsc_swarm.flight.in_process import fly
from rsc_swarm.flight.report import report_of
from rsc_swarm.flight.simulate import simulate
from tests import loopback
from tests.models import random_model, saved
from tests.scenarios.flights import Fields, launched, whole

TWENTY_FIVE: Fields = {"agents": 25, "fly_s": 0.8, "start": {"scrambled": True}}
SIX: Fields = {"agents": 6, "fly_s": 2.5, "start": {"scrambled": True}, "seed": 6}

RADIOS: dict[str, Fields] = {
    "perfect": {},
    "loss": {"loss": 0.3},
    "burst": {"burst": {"loss": 0.5, "length_s": 0.3}},
    "delay-jitter-duplicates-reordering": {"delay_ms": 20, "jitter_ms": 30, "duplicate": 0.2, "reorder": 0.2},
    "ten-hertz": {"frame_rate_hz": 10},
    "everything": {
        "loss": 0.1,
        "burst": {"loss": 0.2},
        "delay_ms": 10,
        "jitter_ms": 20,
        "duplicate": 0.1,
        "reorder": 0.1,
        "frame_rate_hz": 50,
    },
}


def flown_here(fields: Fields) -> tuple[Fields, Fields]:
    """The same flight in this process: its outcome, as a report tells it, and all of its report that a flight decides."""
    mission = parse_mission(fields)
    flown = fly(mission)
    outcome: Fields = json.loads(json.dumps(asdict(flown.outcome)))
    return outcome, whole(report_of(flown, mission, "simulate", "lockstep", "").model_dump(mode="json"))


def simulated(fields: Fields) -> Fields:
    """The outcome of the same flight in this process."""
    return flown_here(fields)[0]


@pytest.mark.parametrize(
    ("task", "radios"),
    [(SIX, ["perfect", "ten-hertz", "everything"]), (TWENTY_FIVE, ["perfect", "everything"])],
    ids=["six", "twenty-five"],
)
def test_launch_and_simulate_fly_the_same_flight(task: Fields, radios: list[str]) -> None:
    tasks = [{**task, "radio": RADIOS[radio]} for radio in radios]
    flights = launched(*tasks)
    digests = [flight["outcome"]["digest"] for flight in flights]
    assert len(set(digests)) == len(tasks), "every radio makes a flight of its own"
    for name, fields, flight in zip(radios, tasks, flights, strict=True):
        assert (flight["outcome"], whole(flight["report"])) == flown_here(fields), name
        assert flight["breach"] is None
        assert flight["rejected"] == 0
    assert all(flight["outcome"]["ticks"] == round(100 * task["fly_s"]) for flight in flights)


def test_twins_agree_to_the_very_end_of_a_whole_flight() -> None:
    task: Fields = {"agents": 6, "map_seed": 3, "hold_s": 0.5}
    (flight,) = launched(task)
    assert flight["outcome"]["success"]
    assert (flight["outcome"], whole(flight["report"])) == flown_here(task)


@pytest.mark.parametrize(
    "way",
    [
        {"aim": "chain"},
        {"sensing": {"neighbours": "heard"}},
        {"swap": {"rule": "tree"}},
        {"policy": "cruise"},
        {"swap": {"protocol": "highest-version"}, "faults": [{"at_s": 1, "kind": "restart", "agents": [2]}]},
    ],
    ids=["chain", "heard", "tree", "cruise", "highest-version"],
)
def test_twins_agree_however_the_swarm_flies(way: Fields) -> None:
    # Over bytes, without processes: all else that could make a difference is the same for all of them.
    task = {**SIX, **way, "radio": {"loss": 0.2}}
    assert loopback.fly(parse_mission(task)).outcome == simulate([parse_mission(task)])[0]


@pytest.mark.parametrize("radio", RADIOS)
def test_twins_agree_over_every_radio(radio: str) -> None:
    task = parse_mission({**SIX, "radio": RADIOS[radio]})
    assert loopback.fly(task).outcome == simulate([task])[0]


def test_a_drone_among_a_hundred_hears_them_all() -> None:
    """Over bytes: the messages of such a crowd are longer than the transport carries, and travel in pieces."""
    crowd = parse_mission({"agents": 100, "policy": "analytic", "radio": {"range_m": 100}})
    short = crowd.model_copy(update={"fly_s": 0.05})
    assert loopback.fly(short).outcome == simulate([short])[0]


def test_twins_agree_when_a_model_flies(tmp_path: Path) -> None:
    """Each drone asks its model for itself; in one process one question is asked for all whose turn it is."""
    path = tmp_path / "random.onnx"
    saved(path, random_model(20, 128, wide=True))
    flown: Fields = {**SIX, "policy": str(path), "trajectory": {"replan_ticks": 10}}
    tasks = [
        flown,
        {**flown, "radio": {"loss": 0.3}, "faults": [{"at_s": 1, "kind": "restart", "agents": [2]}]},
    ]
    for fields, flight in zip(tasks, launched(*tasks), strict=True):
        assert flight["outcome"] == simulated(fields)
        assert flight["breach"] is None


def test_the_same_seed_is_the_same_flight_and_another_seed_another() -> None:
    lossy: Fields = {**SIX, "fly_s": 1.0, "radio": RADIOS["everything"]}
    digests = [flight["outcome"]["digest"] for flight in launched(lossy, lossy, {**lossy, "seed": 7})]
    assert digests[0] == digests[1]
    assert digests[0] != digests[2]


def test_no_frame_from_beyond_radio_range_reaches_a_drone() -> None:
    """In real processes: the world counts what it delivers, and each drone reaches only the one beside it."""
    abreast: Fields = {
        "agents": 6,
        "formation": {"shape": "line"},
        "start": {"radius_m": 0},
        "obstacles": {"discs": []},
        "fly_s": 1.0,
    }
    (flight,) = launched(abreast)
    tally: dict[str, Any] = flight["tally"]
    # Six abreast have five pairs: ten directed links. The last tick's frames are still under way at the end.
    assert tally["sent"] == 600
    assert tally["delivered"] == 10 * 99
    assert tally["out_of_range"] == 20 * 100
