"""What the fields of a mission say about each other, and what would be right."""

from collections.abc import Iterable
from typing import Any

import pytest

from protocols.mission.document import Mission, parse_mission
from tests.protocols.test_mission import refusal


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


def test_drones_that_start_in_contact_are_refused() -> None:
    text = refusal({"limits": {"collision_m": 1.5}})
    assert text == "start.gap_m: 1 m is a collision by limits.collision_m = 1.5 m; give at least 1.5"
    assert parse_mission({"limits": {"collision_m": 1.5}, "start": {"gap_m": 1.5}}).start.gap_m == 1.5


def test_an_obstacle_must_be_seen_before_it_is_hit() -> None:
    assert refusal({"sensing": {"range_m": 0.4}}).startswith(
        "sensing.range_m: 0.4 m is too short for limits.collision_m"
    )


@pytest.mark.parametrize(
    ("rate", "every"),
    [(100, 1), (50, 2), (33.333, 3), (33.3, 3), (16.7, 6), (10, 10), (0.5, 200), (0.2, 500)],
)
def test_a_frame_rate_is_flown_as_asked(rate: float, every: int) -> None:
    assert parse_mission({"radio": {"frame_rate_hz": rate}}).frame_every == every


@pytest.mark.parametrize(
    ("rate", "nearest"), [(70, "50 and 100"), (30, "33.33 and 25"), (99, "100 and 50"), (45, "50 and 33.33")]
)
def test_a_frame_rate_that_is_not_so_many_ticks_is_refused_with_the_nearest(
    rate: float, nearest: str
) -> None:
    text = refusal({"radio": {"frame_rate_hz": rate}})
    assert (
        text == f"radio.frame_rate_hz: {rate} Hz is no frame every so many ticks; the nearest are {nearest}"
    )


def test_every_drone_speaks_within_the_flight() -> None:
    assert "not every drone speaks in a flight of 21 s; give at least 0.0476" in refusal(
        {"radio": {"frame_rate_hz": 0.04}}
    )
    parse_mission({"radio": {"frame_rate_hz": 0.05}})


def test_waiting_must_be_longer_than_frames_take() -> None:
    text = refusal({"radio": {"frame_rate_hz": 1, "memory_s": 0.5}})
    assert text.startswith(
        "radio.memory_s: after 0.5 s a frame is forgotten before the next has come, as this radio goes; "
    )
    assert text.endswith("give at least 1.01, or leave it out")
    assert "at least 0.53" in refusal({"radio": {"delay_ms": 500, "jitter_ms": 10, "memory_s": 0.5}})
    text = refusal({"radio": {"frame_rate_hz": 1}, "swap": {"answer_s": 0.5}})
    assert text.startswith("swap.answer_s: after 0.5 s no answer can have come")
    text = refusal({"radio": {"frame_rate_hz": 0.2}, "swap": {"silent_s": 4}})
    # One frame to a go-between, four until it has told of all 25: 25 s, and rounding.
    assert text.startswith(
        "swap.silent_s: after 4 s drones that live are taken for dead, as this radio goes; "
    )
    assert text.endswith("give at least 25.12, or leave it out")


def test_waiting_that_is_left_out_is_as_long_as_usual_or_as_frames_take() -> None:
    def waits(**radio: Any) -> tuple[int, int, int]:
        mission = parse_mission({"radio": radio})
        return mission.memory_ticks, mission.answer_ticks, mission.silent_ticks

    assert waits() == (50, 50, 400)
    assert waits(frame_rate_hz=10) == (50, 50, 412)
    assert waits(frame_rate_hz=1) == (101, 202, 862)
    assert waits(loss=1) == (50, 50, 360_000)  # nobody hears anybody
    assert waits(frame_rate_hz=0.5, loss=0.3)[2] > waits(frame_rate_hz=0.5)[2] == 1362


def _rises(numbers: Iterable[int]) -> bool:
    found = list(numbers)
    return found == sorted(found)


def test_more_loss_rarer_frames_and_more_drones_never_shorten_the_silence() -> None:
    def silence(agents: int = 25, **radio: Any) -> int:
        return parse_mission({"agents": agents, "radio": radio}).silent_ticks

    assert _rises(silence(frame_rate_hz=10, loss=loss) for loss in (0, 0.1, 0.5, 0.9, 0.999, 1))
    assert _rises(silence(frame_rate_hz=10, delay_ms=delay) for delay in (0, 10, 500))
    assert _rises(silence(frame_rate_hz=rate) for rate in (100, 10, 1, 0.5, 0.1))
    assert silence(4, frame_rate_hz=1) < silence(25, frame_rate_hz=1) < silence(100, frame_rate_hz=1)


def test_a_spell_is_no_shorter_than_its_loss_needs() -> None:
    text = refusal({"radio": {"burst": {"loss": 0.99, "length_s": 0.1}}})
    assert text.startswith(
        "radio.burst.length_s: 0.1 s is too short for spells that lose 0.99 of all frames; give at least 0.99"
    )
    parse_mission({"radio": {"burst": {"loss": 0.99, "length_s": 0.99}}})


@pytest.mark.parametrize("field", ["delay_ms", "jitter_ms"])
def test_a_delay_of_less_than_half_a_tick_is_none(field: str) -> None:
    assert (
        refusal({"radio": {field: 4}})
        == f"radio.{field}: 4 ms is nothing in ticks of 10 ms; give 0, or at least 5"
    )


@pytest.mark.parametrize(
    "fields",
    [{"hold_s": 0.123}, {"fly_s": 0.005}, {"radio": {"memory_s": 0.505}}, {"swap": {"cooldown_s": 1e-3}}],
    ids=lambda fields: next(iter(fields)),
)
def test_a_time_between_two_ticks_is_refused(fields: dict[str, Any]) -> None:
    text = refusal(fields)
    assert "is no whole number of ticks of 0.01 s; give " in text or "greater than or equal to 0.01" in text


def test_a_target_must_be_slower_than_the_drones() -> None:
    text = refusal({"target": {"speed_mps": 10}})
    assert (
        text
        == "target.speed_mps: 10 m/s leaves drones of limits.speed_mps = 10 m/s behind; give less than that"
    )


def test_a_time_limit_that_cannot_be_met_is_refused_with_the_least_that_can() -> None:
    text = refusal({"agents": 169, "time_limit_s": 21})
    assert text == (
        "time_limit_s: the formation cannot be beyond the goal line within 21 s; give at least 21.50, or fly_s: 21 to fly only "
        "the beginning"
    )
    parse_mission({"agents": 169, "time_limit_s": 21.5})
    assert refusal({"goal_x_m": 100, "time_limit_s": 21}).startswith("time_limit_s: ")
    far = {"obstacles": {"discs": [[90, 0, 2]]}}
    assert refusal({**far, "time_limit_s": 21}).startswith("time_limit_s: ")
    assert parse_mission({**far, "time_limit_s": 21, "fly_s": 2}).ticks == 200


def test_a_goal_that_the_target_never_reaches_is_refused() -> None:
    assert refusal({"target": {"speed_mps": 0}}).startswith(
        "goal_x_m: with target.speed_mps = 0 the formation is not beyond"
    )
    assert refusal({"goal_x_m": 1e6}).startswith("goal_x_m: ")
    assert (
        parse_mission({"target": {"speed_mps": 0}, "goal_x_m": -100, "obstacles": {"count": [0, 0]}}).ticks
        == 2100
    )
    assert parse_mission({"goal_x_m": 1e6, "fly_s": 3600}).ticks == 360_000


def test_drones_too_slow_to_get_up_speed_are_refused_with_the_least_that_do() -> None:
    assert refusal({"limits": {"acceleration_mps2": 0.1}}) == (
        "limits.acceleration_mps2: with 0.1 m/s² no drone that begins behind is beyond the goal line within 21 s; "
        "give at least 0.182, or a longer time_limit_s"
    )
    for fields in (
        {"limits": {"acceleration_mps2": 0.182}},
        {"limits": {"acceleration_mps2": 0.1}, "time_limit_s": 60},
    ):
        parse_mission(fields)
    parse_mission({"limits": {"acceleration_mps2": 0.1}, "fly_s": 3})


def test_the_usual_time_grows_with_the_depth_of_the_formation() -> None:
    seconds = {agents: parse_mission({"agents": agents}).ticks / 100 for agents in range(1, 251)}
    assert all(seconds[agents] == 21 for agents in (1, 4, 6, 9, 12, 16, 25, 36, 49))
    assert (seconds[26], seconds[169]) == (28, 27)
    for agents, allowed in seconds.items():
        parse_mission({"agents": agents, "time_limit_s": allowed})  # no shape of auto must fail
    assert parse_mission({"target": {"speed_mps": 1}}).ticks == 5700
    assert parse_mission({"goal_x_m": 100}).ticks == 4400


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


def fault(at_s: float, kind: str, **what: Any) -> dict[str, Any]:
    return {"at_s": at_s, "kind": kind, **what}


@pytest.mark.parametrize(
    ("faults", "line"),
    [
        ([fault(30, "kill", agents=[1])], "faults.0.at_s: 30 s is after the end of the flight (21 s); give less, or"),
        ([fault(1, "kill", agents=[1]), fault(2, "kill", agents=[1])], "faults.1: drone 1 is dead already at 2 s; leave"),
        ([fault(2, "kill", agents=[1]), fault(1, "kill", slots=[1])], "faults.0: drone 1 is dead already at 2 s"),
        ([fault(1, "kill", agents=[1]), fault(2, "freeze", agents=[1])], "faults.1: drone 1 is dead or frozen already"),
        ([fault(1, "thaw", agents=[1])], "faults.0: drone 1 is not frozen at 1 s; leave this thaw out, or change the time"),
        ([fault(2, "freeze", agents=[1]), fault(1, "thaw", agents=[1])], "faults.1: drone 1 is not frozen at 1 s"),
        ([fault(1, "recover", slots=[1])], "faults.0: drone 1 is not slowed"),
        ([fault(1, "kill", agents=[*range(25)])], "faults.0: with it all are dead at 1 s; leave at least one alive"),
        ([fault(2, "kill", slots=[*range(9, 25)]), fault(1, "kill", agents=[*range(9)])], "faults.0: with it all are dead"),
        ([fault(1, "freeze", agents=[1, 2]), fault(1, "thaw", agents=[1])], "faults.1: this thaw undoes faults.0 in the"),
        ([fault(1, "kill", agents=[1]), fault(1, "restart", agents=[1])], "faults.1: this restart undoes faults.0"),
        ([fault(1, "slow", slots=[1]), fault(1, "recover", slots=[1])], "faults.1: this recover undoes faults.0"),
        ([fault(1, "part", groups=[[1], [2]]), fault(1, "heal")], "faults.1: this heal undoes faults.0"),
        ([fault(1, "loss", loss=1), fault(1, "loss", loss=0.5)], "faults.1: this loss undoes faults.0"),
        ([fault(1, "truth", agents=[1])], "faults.0: drone 1 is not lying at 1 s"),
        ([fault(1, "lie", agents=[1], lie="digest"), fault(1, "truth", agents=[1])], "faults.1: this truth undoes faults.0"),
        ([fault(1, "lie", agents=[1])], "faults.0: lie: say which, one of position, impossible-motion, displacement, ob"),
        ([fault(1, "slow", agents=[1], lie="digest")], "faults.0: lie: means nothing to slow; leave it out"),
        ([fault(1, "loss")], "faults.0: loss: say which share of frames is lost, for example 0.3"),
        ([fault(1, "heal", loss=0.3)], "faults.0: loss: means nothing to heal"),
        ([fault(1, "loss", loss=0.3, agents=[1])], "faults.0: agents: means nothing to loss"),
        ([fault(1, "part", groups=[[1], [2]]), fault(2, "heal"), fault(3, "loss", loss=1), fault(4, "heal")], "faults.3: the"),
        ([fault(1, "heal")], "faults.0: the radio is not parted at 1 s; leave this heal out"),
        ([fault(1, "kill", agents=[1, 1])], "faults.0: names a drone twice; name each once"),
        ([fault(1, "kill", agents=[1], slots=[1])], "faults.0: names a drone twice; name each once"),
        ([fault(1, "kill", agents=[1], factor=0.7)], "faults.0: factor: means nothing to kill; leave it out"),
        ([fault(1, "kill", agents=[1], groups=[[1], [2]])], "faults.0: groups: means nothing to kill"),
        ([fault(1, "part", groups=[[1], [2]], agents=[1])], "faults.0: agents: means nothing to part"),
        ([fault(1, "part", groups=[[1, 2], [2]])], "faults.0: groups: agent 2 is named twice; give it to one group"),
        ([fault(1, "part", groups=[[1, 2], []])], "faults.0: groups: a group is empty"),
        ([fault(1, "part", groups=[[1], [25]])], "faults.0: there is no agent or slot 25; numbers go from 0 to 24"),
        ([fault(-1, "heal")], "faults.0.at_s: input should be greater than or equal to 0, not -1"),
    ],
)  # fmt: skip
def test_a_fault_that_would_do_nothing_is_refused(faults: list[dict[str, Any]], line: str) -> None:
    assert refusal({"faults": faults}).startswith(line)


def test_faults_that_undo_each_other_are_flown() -> None:
    kinds = [
        fault(1, "kill", agents=[1]), fault(2, "restart", agents=[1]), fault(3, "kill", agents=[1]),
        fault(1, "restart", agents=[2]),
        fault(4, "freeze", agents=[2]), fault(5, "thaw", slots=[2]), fault(6, "freeze", agents=[2]),
        fault(1, "slow", agents=[3]), fault(2, "slow", agents=[3], factor=0.2), fault(3, "recover", agents=[3]),
        fault(1, "part", groups=[[0], [1]]), fault(2, "part", groups=[[0, 1], [2]]), fault(3, "heal"),
        fault(1, "lie", agents=[4], lie="digest"), fault(2, "lie", agents=[4], lie="replay"), fault(3, "truth", agents=[4]),
    ]  # fmt: skip
    assert len(parse_mission({"faults": kinds}).faults) == len(kinds)


def test_who_holds_a_slot_of_a_scrambled_start_is_not_guessed() -> None:
    faults = [fault(1, "kill", slots=[1]), fault(2, "kill", agents=[1])]
    assert refusal({"faults": faults}).startswith("faults.1: drone 1 is dead already")
    parse_mission({"faults": faults, "start": {"scrambled": True}})


def test_a_fault_may_come_while_a_formation_is_held() -> None:
    parse_mission({"faults": [fault(22, "kill", agents=[1])], "hold_s": 2})
    assert Mission(faults=(fault(20.99, "kill", agents=[1]),)).faults[0].at_tick == 2099  # type: ignore[arg-type]
