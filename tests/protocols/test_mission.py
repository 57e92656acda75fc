"""Missions: what can be flown, and how a wrong one is refused, in one line that says what would be right."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from protocols.mission.document import Mission, MissionError, parse_mission, read_mission_fields

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
    assert (mission.agents, mission.policy, len(mission.plan)) == (25, "rsc-h20", 25)
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
    fields = {"radio": {"frame_rate_hz": 10}, "time_limit_s": 3.5, "faults": [{"at_s": 4.5, "kind": "heal"}]}
    mission = parse_mission(fields)
    assert (mission.frame_every, mission.ticks, mission.faults[0].at_tick) == (10, 350, 450)


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


def test_a_slot_tree_in_two_pieces_is_refused() -> None:
    spec = {"shape": "custom", "slots_m": [[0, 0], [5, 0], [5, 5], [20, 0]]}
    text = refusal({"agents": 4, "formation": spec})
    assert text.startswith("formation.slots_m: the slot tree is not connected: slots [3] ")
    assert "move them to 5 m from a connected slot" in text


def test_two_slots_too_close_are_refused() -> None:
    spec = {"shape": "custom", "slots_m": [[0, 0], [5, 0], [5, 0.3]]}
    text = refusal({"agents": 3, "formation": spec})
    assert text == "formation.slots_m: slots 1 and 2 are 0.30 m apart; keep slots at least 2.50 m apart"


def test_slots_closer_than_a_collision_are_refused() -> None:
    text = refusal({"formation": {"spacing_m": 0.8}})
    assert text.startswith(
        "formation.spacing_m: 0.8 m is too close for limits.collision_m = 0.5 m; give at least 1"
    )


def test_a_radio_that_does_not_reach_along_an_edge_is_refused() -> None:
    text = refusal({"radio": {"range_m": 4.5}})
    assert text == "radio.range_m: 4.5 m is shorter than the formation's edges (5 m); give at least 5"


def test_as_many_slots_as_agents_are_demanded() -> None:
    text = refusal({"agents": 24, "formation": {"shape": "square"}})
    assert text == "agents: a square needs 4, 9, 16, 25, 36, ... agents, not 24"
    text = refusal({"agents": 25, "formation": {"shape": "triangle"}})
    assert text == "agents: a hollow triangle needs 3, 6, 9, 12, ... agents, not 25"
    text = refusal({"agents": 3, "formation": {"shape": "custom", "slots_m": [[0, 0], [5, 0]]}})
    assert text == "agents: 3, but formation.slots_m has 2 slots; make them equal"


def test_slots_and_shape_custom_go_together() -> None:
    assert refusal({"formation": {"shape": "custom"}}).startswith(
        "formation.slots_m: give slot positions together with"
    )
    assert refusal({"agents": 2, "formation": {"slots_m": [[0, 0], [5, 0]]}}).startswith(
        "formation.slots_m: give "
    )


def test_numbers_out_of_their_range_are_named() -> None:
    assert refusal({"agents": 0}).startswith("agents: input should be greater than or equal to 1, not 0")
    assert refusal({"agents": 251}).startswith("agents: input should be less than or equal to 250")
    assert refusal({"radio": {"loss": 1.5}}).startswith("radio.loss: ")
    assert refusal({"target": {"speed_mps": float("nan")}}).startswith("target.speed_mps: ")
    assert refusal({"obstacles": {"count": [6, 3]}}).startswith("obstacles: count: [6, 3] is upside down")
    assert refusal({"obstacles": {"count": [3, 17]}}).startswith("obstacles: count: give between 0 and 16")
    assert refusal({"swarm": "a/b"}).startswith("swarm: ")


def test_faults_name_drones_that_exist() -> None:
    fault = {"at_s": 1, "kind": "kill", "agents": [6]}
    assert (
        refusal({"agents": 6, "faults": [fault]})
        == "faults.0: there is no agent or slot 6; numbers go from 0 to 5"
    )
    assert refusal({"faults": [{"at_s": 1, "kind": "kill"}]}).startswith(
        "faults.0: agents: name at least one agent"
    )
    part = {"at_s": 1, "kind": "part", "groups": [[0]]}
    assert refusal({"faults": [part]}).startswith("faults.0: groups: a part needs at least two groups")


def test_several_mistakes_are_told_at_once() -> None:
    assert refusal({"agents": -1, "seed": "x"}).count("; ") == 1


def _fields_of(section: dict[str, Any], place: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    found = []
    for name, value in section.items():
        found.append((*place, name))
        if isinstance(value, dict):
            found += _fields_of(value, (*place, name))
    return found


JUNK = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(), st.lists(st.integers(), max_size=4),
    st.dictionaries(st.sampled_from(["agents", "x", "loss"]), st.integers(), max_size=2),
)  # fmt: skip


@given(field=st.sampled_from(_fields_of(Mission().model_dump(mode="json"))), junk=JUNK)
def test_whatever_is_written_into_a_field_gives_a_mission_or_one_line_that_names_it(
    field: tuple[str, ...], junk: object
) -> None:
    fields: dict[str, Any] = {}
    place = fields
    for section in field[:-1]:
        place = place.setdefault(section, {})
    place[field[-1]] = junk
    with suppress(MissionError):
        parse_mission(fields)
        return
    text = refusal(fields)
    assert field[-1] in text or field[0] in text


def test_a_mission_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    def complaint(content: bytes) -> str:
        path = tmp_path / "m.yaml"
        path.write_bytes(content)
        with pytest.raises(MissionError) as caught:
            read_mission_fields(path)
        assert "\n" not in str(caught.value)
        return str(caught.value).removeprefix(f"{path}: ")

    assert complaint(b"- 1\n- 2\n").startswith("must be a mapping of fields such as 'agents: 25', not a list")
    assert complaint(b"agents: [1\nname: x").startswith("is not valid YAML at line 2")
    assert complaint(b"\xff\xfe\x00").startswith("is not UTF-8 text")
    with pytest.raises(MissionError, match="cannot be read"):
        read_mission_fields(tmp_path / "nowhere.yaml")


def test_a_mission_file_may_be_empty(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text("# nothing\n")
    assert read_mission_fields(path) == {}
    assert yaml.safe_load(path.read_text()) is None


def test_off_may_be_written_as_yaml_likes_to_read_it() -> None:
    assert parse_mission(yaml.safe_load("swap: {rule: off}")).swap.rule == "off"
