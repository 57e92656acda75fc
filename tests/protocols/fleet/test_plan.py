"""A fleet that cannot be flown is refused in one line that says where and what would be right."""

import math
from pathlib import Path
from typing import Any

import pytest

from protocols.fleet.document import Fleet, FleetError, parse_fleet, read_fleet
from protocols.fleet.plan import Plan, make_plan
from protocols.mission.document import Mission, parse_mission

MISSION = parse_mission(
    {
        "name": "three",
        "agents": 3,
        "formation": {"shape": "triangle"},
        "target": {"speed_mps": 2},
        "obstacles": {"discs": [[10, 0, 1]]},
        "goal_x_m": 12,
    }
)


def fleet(**changes: Any) -> Fleet:
    fields: dict[str, Any] = {
        "mission": "three",
        "origin_m": [-3, 0],
        "scale": 0.3,
        "fence": {"x_m": [-4, 5], "y_m": [-2, 2]},
        "drones": [
            {"number": number, "body": f"mavlink:udpin:0.0.0.0:{14550 + number}"} for number in range(3)
        ],
    }
    return parse_fleet(fields | changes)


def plan(mission: Mission = MISSION, **changes: Any) -> Plan:
    return make_plan(fleet(**changes), mission)


def drones(*specs: dict[str, Any]) -> list[dict[str, Any]]:
    return [{"number": number, "body": "point:"} | spec for number, spec in enumerate(specs)]


def test_lengths_speeds_and_obstacles_are_the_missions_to_scale() -> None:
    made = plan()
    assert made.limit_m == pytest.approx(0.15)
    assert made.speed_mps == pytest.approx(3.0)
    assert made.acceleration_mps2 == pytest.approx(3.0)
    ((x, y, radius),) = made.obstacles
    assert (x, y, radius) == pytest.approx((0.0, 0.0, 0.3))
    assert made.mission_obstacles[0] == pytest.approx((10.0, 0.0, 1.0))


def test_drones_hear_of_each_other_only_by_frames_at_the_rate_of_the_air() -> None:
    made = plan()
    assert made.mission.sensing.neighbours == "heard"
    assert made.mission.radio.frame_rate_hz == 25.0


def test_what_goes_wrong_on_the_air_is_no_fault_of_the_mission() -> None:
    faults = [{"at_s": 1, "kind": "kill", "agents": [1]}]
    assert plan(parse_mission(MISSION.model_dump(mode="json") | {"faults": faults})).mission.faults == ()


def test_who_gives_no_start_stands_at_its_slot() -> None:
    made = plan(drones=drones({}, {"start_m": [-3.5, 0.1]}, {}))
    slots = made.slots_at(0)
    assert made.starts == (slots[0], (-3.5, 0.1), slots[2])


def test_the_flight_ends_when_the_formation_has_had_time_behind_the_goal() -> None:
    made = plan()
    rear = min(x for x, _ in made.slots_at(made.ticks))
    goal, _ = made.place.to_room((12.0, 0.0))
    assert goal < rear < goal + 2.0


def test_other_missions_and_fleets_have_other_digests() -> None:
    made, other = plan(), plan(height_m=1.2)
    assert made.fleet_digest == plan().fleet_digest == plan(keys="keys").fleet_digest
    assert made.fleet_digest != other.fleet_digest
    assert made.mission_digest == other.mission_digest
    faster = MISSION.model_copy(update={"target": MISSION.target.model_copy(update={"speed_mps": 1.9})})
    assert plan(faster).mission_digest != made.mission_digest


BAD: list[tuple[str, dict[str, Any], str]] = [
    ("an unknown field", {"hight_m": 1}, "hight_m: unknown field; known here: drones"),
    ("an unknown field of a drone", {"drones": [{"number": 0, "uri": "x"}]}, "drones.0.uri: unknown field"),
    ("a scale too small", {"scale": 0.2}, "scale: .*0.25"),
    ("a scale too large", {"scale": 1.5}, "scale: .*1"),
    ("text for a scale", {"scale": "0.3"}, "scale: .*number"),
    ("too few drones", {"drones": drones({}, {})}, "drones: 2, and mission three is for 3"),
    ("nobody", {"drones": []}, "drones: "),
    ("a number twice", {"drones": drones({}, {}, {"number": 1})}, "numbers are 0, 1, 1; number them from 0"),
    ("a number left out", {"drones": drones({}, {}, {"number": 3})}, "numbers are 0, 1, 3"),
    ("two at one address", {"drones": drones({"address": "udp/10.0.0.1:7"}, {}, {"address": "udp/10.0.0.1:7"})},
     "drones.2.address: udp/10.0.0.1:7 is that of drones.0.address, too"),
    ("the operator's address", {"ground": "udp/127.0.0.1:7452"}, "drones.1.address: udp/127.0.0.1:7452 is that of ground, too"),
    ("the world at a drone's address", {"world": {"address": "udp/127.0.0.1:7452"}},
     "drones.1.address: udp/127.0.0.1:7452 is that of world.address, too"),
    ("a plain world elsewhere", {"world": {"address": "udp/10.0.0.1:7452"}}, "world.address: udp/10.0.0.1:7452 is plain text"),
    ("a virtual obstacle at the obstacle", {"world": {"obstacles_m": [[0.1, 0.1, 0.2]]}},
     "world.obstacles_m.0: its centre is 0.14 m from another's, and drones take two within 0.3 m for one"),
    ("a virtual obstacle beyond the goal", {"world": {"obstacles_m": [[0.7, 1, 0.2]]}},
     "world.obstacles_m.0: it ends at x = 13.0 m of the mission, beyond the goal line at 12.0 m"),
    ("a virtual obstacle at a start", {"world": {"obstacles_m": [[-3.0, 0, 0.2]]}}, "start_m: drone . stands .* from obstacle 1"),
    ("too much noise", {"world": {"noise_m": 1}}, "world.noise_m: .*0.1"),
    ("no address", {"drones": drones({"address": "10.0.0.1"}, {}, {})}, "drones.0.address: '10.0.0.1' is no address; write"),
    ("no port", {"ground": "udp/10.0.0.1:99999"}, "ground: .* is no address"),
    ("a wire for all to read", {"drones": drones({"address": "udp/10.0.0.1:7000"}, {}, {})},
     "drones.0.address: udp/10.0.0.1:7000 is plain text"),
    ("the second port of another", {"keys": "keys", "ground": "quic/10.0.0.1:7000",
      "drones": drones({"address": "quic/10.0.0.1:8000"}, {}, {})},
     "drones.0.address: quic/10.0.0.1:8000 and ground: quic/10.0.0.1:7000 would both listen at quic/10.0.0.1:8000, for"),
    ("its own second port", {"keys": "keys", "ground": "quic/10.0.0.1:8000",
      "drones": drones({"address": "quic/10.0.0.1:7000"}, {}, {})},
     "drones.0.address: quic/10.0.0.1:7000 and ground: quic/10.0.0.1:8000 would both listen at quic/10.0.0.1:8000, for"),
    ("one second port of two", {"keys": "keys", "ground": "quic/10.0.0.1:64600",
      "drones": drones({"address": "quic/10.0.0.1:62600"}, {}, {})},
     "drones.0.address: quic/10.0.0.1:62600 and ground: quic/10.0.0.1:64600 would both listen at quic/10.0.0.1:63600, for"),
    ("a secret without keys", {"ground": "quic/10.0.0.1:7000"}, "ground: quic/10.0.0.1:7000 needs keys"),
    ("keys and plain text", {"keys": "keys", "ground": "udp/127.0.0.1:7000"}, "ground: .* is plain text, and the fleet has keys"),
    ("starts too near", {"drones": drones({}, {"start_m": [-3, 0.1]}, {"start_m": [-3, 0]})}, "0.10 m apart, and 0.15 m"),
    ("a start in an obstacle", {"obstacles_m": [[-3, 0.4, 0.3]]}, "stands .* m from obstacle 0"),
    ("a short fence", {"fence": {"x_m": [-4, 2], "y_m": [-2, 2]}}, r"fence.x_m: .* smaller than the way; give at least \["),
    ("a narrow fence", {"fence": {"x_m": [-4, 5], "y_m": [0.5, 2]}}, "fence.y_m: .* smaller than the way"),
    ("a low fence", {"fence": {"x_m": [-4, 5], "y_m": [-2, 2], "z_m": [0, 1.1]}}, "fence.z_m: .* smaller than the way"),
    ("a fence upside down", {"fence": {"x_m": [5, -4], "y_m": [-2, 2]}}, "x_m: .* upside down"),
    ("a turned mission", {"yaw_deg": 90}, "fence.x_m: .* smaller than the way"),
    ("no fence", {"fence": None}, "fence: "),
    ("too few heights", {"slot_heights_m": [1, 1.2]}, "slot_heights_m: 2 heights for 3 slots"),
    ("one height and many", {"height_m": 1, "slot_heights_m": [1, 1, 1]}, "height_m: slot_heights_m says it of each slot"),
    ("noise of no obstacles", {"world": {"noise_m": 0.05}}, "world.noise_m: the world adds no obstacles"),
    ("limits upside down", {"guard": {"position_hold_s": 2}}, "position_hold_s: 2 is not less than position_land_s"),
    ("a fence in millimetres", {"fence": {"x_m": [-4000, 5000], "y_m": [-2, 2]}}, "keeps nobody in; give it in metres"),
    ("a ceiling in millimetres", {"fence": {"x_m": [-4, 5], "y_m": [-2, 2], "z_m": [0, 2500]}}, "fence.z_m: .* keeps nobody in"),
    ("a floor above the ground", {"fence": {"x_m": [-4, 5], "y_m": [-2, 2], "z_m": [0.2, 2]}},
     r"fence.z_m: \[0.2, 2\] is smaller than the way; give at least \[0, 1.2\]"),
    ("a fence that is turned", {"fence": {"x_m": [-2, 2], "y_m": [-4, 5]}}, r"fence.x_m: \[-2, 2\] is smaller than the way"),
    ("a height in centimetres", {"height_m": 80}, "fence.z_m: .* smaller than the way"),
    ("a turn in radians", {"yaw_deg": 3.14159, "origin_m": [3, 0]}, "fence.x_m: .* smaller than the way"),
    ("a turn that is no number", {"yaw_deg": math.nan}, "yaw_deg: .* finite number"),
    ("an origin out of this world", {"origin_m": [1e300, 0]}, "origin_m.0: .*1000000"),
    ("an origin of three numbers", {"origin_m": [-3, 0, 0]}, "origin_m: write at most 2 values"),
    ("a start as text", {"drones": drones({"start_m": "-3, 0"}, {}, {})}, "drones.0.start_m: write a list"),
    ("an obstacle where they land", {"obstacles_m": [[3, 0, 0.3]]}, "fence.x_m: .* smaller than the way"),
    ("a tilt in radians", {"guard": {"tilt_land_deg": 0.87}}, "guard.tilt_land_deg: .* 5"),
    ("a battery in per cent", {"guard": {"battery_land": 20}}, "guard.battery_land: .* 1"),
    ("milliseconds in seconds", {"guard": {"clock_hold_ms": 0.02}}, "guard.clock_hold_ms: .* 1"),
    ("seconds in milliseconds", {"guard": {"position_hold_s": 150, "position_land_s": 500}}, "guard.position_hold_s: .* 10"),
    ("a limit that is none", {"guard": {"jump_m": 1e6}}, "guard.jump_m: .* 100"),
    ("a limit that is always passed", {"guard": {"setpoint_hold_s": 0.01}}, "guard.setpoint_hold_s: .* 0.05"),
    ("ports beyond the last", {"radio": {"port": 65000}}, "radio.port: .*64000"),
    ("an address of everywhere", {"ground": "quic/0.0.0.0:7000", "keys": "keys"}, "is no machine that others could reach"),
    ("an operator out of reach", {"keys": "keys", "drones": drones(*({"address": f"quic/10.0.0.{i}:7000"} for i in range(3)))},
     "ground: quic/127.0.0.1:7450 is reached on its own machine alone, and drones.0.address is on another: quic/10.0.0.0:7000"),
    ("a frame rate between", {"radio": {"frame_rate_hz": 70}}, "frame_rate_hz: 70 Hz .* nearest"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "why"), [bad[1:] for bad in BAD], ids=[bad[0] for bad in BAD])
def test_what_cannot_be_flown_is_refused(changes: dict[str, Any], why: str) -> None:
    with pytest.raises(FleetError, match=why) as refusal:
        plan(**changes)
    assert "\n" not in str(refusal.value)


def test_a_room_must_say_what_stands_in_it() -> None:
    by_chance = parse_mission({"agents": 3, "formation": {"shape": "triangle"}})
    with pytest.raises(FleetError, match=r"obstacles_m: .* by chance"):
        plan(by_chance)
    wide = {"fence": {"x_m": [-99, 99], "y_m": [-99, 99]}}
    assert plan(by_chance, obstacles_m=[], **wide).obstacles == ()


def test_keys_make_all_links_secret_and_plain_text_leaves_a_machine_only_when_told_to() -> None:
    made = plan(keys="keys").fleet
    assert (made.ground_address, made.address(2)) == ("quic/127.0.0.1:7450", "quic/127.0.0.1:7453")
    away = drones(*({"address": f"udp/10.0.0.{i}:7000"} for i in (2, 3, 4)))
    told = plan(ground="udp/10.0.0.1:7000", drones=away, radio={"plain_text": True}).fleet
    assert (told.ground_address, told.address(0)) == ("udp/10.0.0.1:7000", "udp/10.0.0.2:7000")


def test_obstacles_of_the_room_decide_how_far_is_flown() -> None:
    """The formation has to be behind all that stands there, as in the mission."""
    near, far = (
        plan(obstacles_m=[[0.0, 0.0, 0.3]]),
        plan(obstacles_m=[[1.0, 0.0, 0.3]], fence={"x_m": [-4, 9], "y_m": [-2, 2]}),
    )
    assert near.ticks == plan().ticks
    assert far.goal_x_m == pytest.approx((1.0 + 0.3 + 3.0) / 0.3)
    rear = min(x for x, _ in far.slots_at(far.ticks))
    assert rear > far.place.to_room((far.goal_x_m, 0.0))[0]


def test_a_mission_may_be_turned_where_there_is_room() -> None:
    made = plan(origin_m=[0, -3], yaw_deg=90, fence={"x_m": [-2, 2], "y_m": [-4, 5]})
    assert made.place.yaw == pytest.approx(math.pi / 2)


def test_a_file_that_is_none_is_named(tmp_path: Path) -> None:
    with pytest.raises(FleetError, match=r"six\.yaml: cannot be read"):
        read_fleet(tmp_path / "six.yaml")
    (tmp_path / "six.yaml").write_text("scale: 0.3\nscale: 0.4\n")
    with pytest.raises(FleetError, match="written twice"):
        read_fleet(tmp_path / "six.yaml")
