"""Missions: what can be flown, and how a wrong one is refused, in one line that says what would be right."""

from pathlib import Path
from typing import Any

import pytest

from protocols.mission.document import MissionError, parse_mission, read_mission_fields

SHIPPED = Path(__file__).resolve().parents[2] / "rsc_swarm" / "missions"


def refusal(fields: dict[str, Any]) -> str:
    """The one line with which ``fields`` are refused."""
    with pytest.raises(MissionError) as caught:
        parse_mission(fields, "my.yaml")
    text = str(caught.value)
    assert text.startswith("my.yaml: ")
    assert "\n" not in text
    return text.removeprefix("my.yaml: ")


def test_an_empty_mission_is_the_standard_task() -> None:
    mission = parse_mission({})
    assert (mission.agents, mission.policy, len(mission.layout)) == (25, "rsc-h20", 25)
    assert (mission.target.speed_mps, mission.radio.range_m, mission.sensing.range_m) == (3.0, 6.0, 6.0)
    limits = mission.limits
    assert (limits.acceleration_mps2, limits.speed_mps, limits.collision_m) == (10, 10, 0.5)
    assert (mission.start.radius_m, mission.start.gap_m) == (5.0, 1.0)
    assert (mission.obstacles.count, mission.obstacles.radius_m) == ((3, 6), (1.0, 2.0))
    assert (mission.obstacles.x_m, mission.obstacles.y_m) == ((15.0, 35.0), (-15.0, 15.0))
    assert (mission.goal_x_m, mission.edge_tolerance, mission.ticks) == (35.0, 0.1, 2100)


@pytest.mark.parametrize("path", sorted(SHIPPED.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_shipped_mission_can_be_flown_and_is_called_like_its_file(path: Path) -> None:
    assert parse_mission(read_mission_fields(path), path.name).name == path.stem


def test_a_mission_survives_the_journey_to_a_drone() -> None:
    mission = parse_mission(
        {
            "agents": 6,
            "radio": {"burst": {"loss": 0.3}},
            "faults": [{"at_s": 1, "kind": "kill", "agents": [2]}],
            "obstacles": {"discs": [[20, 0, 1.5]]},
        }
    )
    assert parse_mission(mission.model_dump(mode="json")) == mission


def test_times_become_ticks_of_ten_milliseconds() -> None:
    fields = {
        "radio": {"frame_rate_hz": 10, "memory_s": 0.2},
        "swap": {"answer_s": 0.3, "silent_s": 0.9},
        "fly_s": 3.5,
        "faults": [{"at_s": 2.5, "kind": "kill", "agents": [0]}],
    }
    mission = parse_mission(fields)
    assert (mission.frame_every, mission.ticks, mission.faults[0].at_tick) == (10, 350, 250)
    assert (mission.memory_ticks, mission.answer_ticks, mission.silent_ticks) == (20, 30, 90)


def test_an_unknown_field_is_named_with_those_that_are_known() -> None:
    assert refusal({"agnets": 25}).startswith("agnets: unknown field; known here: agents, ")
    text = refusal({"radio": {"rnage_m": 7}})
    assert text.startswith("radio.rnage_m: unknown field; known here: ")
    assert "range_m" in text
    assert (
        refusal({"radio": {"burst": {"lost": 1}}})
        == "radio.burst.lost: unknown field; known here: length_s, loss"
    )
    fault = {"at_s": 1, "kind": "kill", "agents": [0], "who": 1}
    assert refusal({"faults": [fault]}).startswith("faults.0.who: unknown field; known here: agents, at_s, ")


def test_numbers_out_of_their_range_are_named() -> None:
    assert refusal({"agents": 0}).startswith("agents: input should be greater than or equal to 1, not 0")
    assert refusal({"agents": 1025}).startswith("agents: input should be less than or equal to 1024")
    assert refusal({"radio": {"loss": 1.5}}).startswith("radio.loss: ")
    assert refusal({"target": {"speed_mps": float("nan")}}).startswith("target.speed_mps: ")
    assert refusal({"obstacles": {"count": [6, 3]}}).startswith("obstacles: count: [6, 3] is upside down")
    assert refusal({"obstacles": {"count": [3, 17]}}).startswith("obstacles: count: give between 0 and 16")
    assert refusal({"swarm": "a/b"}).startswith("swarm: 'a/b' is not a swarm name: use 1 to 64 letters")


def test_several_mistakes_are_told_at_once() -> None:
    assert refusal({"agents": -1, "seed": "x"}).count("; ") == 1


def test_no_text_becomes_a_number_and_no_truth_a_share() -> None:
    assert refusal({"agents": True}) == "agents: write a whole number, not True"
    assert refusal({"agents": "25"}).startswith("agents: write a whole number")
    assert refusal({"radio": {"loss": True}}).startswith("radio.loss: write a number, not True")
    assert refusal({"goal_x_m": "35"}).startswith("goal_x_m: write a number")
    assert refusal({"detour": 1}) == "detour: write true or false, not 1"
    assert refusal({"name": 25}) == "name: write text, not 25"
    assert parse_mission({"goal_x_m": 30}).goal_x_m == 30.0


def test_a_truth_may_be_written_as_people_write_it() -> None:
    mission = parse_mission({"detour": "off", "safety_filter": "no", "start": {"scrambled": "yes"}})
    assert (mission.detour, mission.safety_filter, mission.start.scrambled) == (False, False, True)


def test_off_may_be_written_as_yaml_likes_to_read_it() -> None:
    assert parse_mission({"swap": {"rule": "off"}}).swap.rule == "off"
    assert parse_mission({"swap": {"rule": False}}).swap.rule == "off"


def test_what_is_long_is_told_in_short() -> None:
    deep: list[Any] = []
    for _ in range(5000):
        deep = [deep]
    for value in (10**5000, "x" * 5000, deep, ["y"] * 5000):
        assert len(refusal({"agents": value, "name": value})) < 500
    assert len(refusal({f"field{number}": 1 for number in range(1000)})) < 5000
    assert refusal({"a\nb": 1}).startswith("'a\\nb': unknown field")
