"""A flight for other programs: read back with the library that reads MCAP files, against Foxglove's own schemas."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rsc_swarm as rs
from protocols.errors import SwarmError
from rsc_swarm.cli.fly import fly_once
from rsc_swarm.flight.events import end_told
from rsc_swarm.flight.recorded import Recorded
from rsc_swarm.show.foxglove import file as mcap_file
from rsc_swarm.show.foxglove.file import McapError, check_mcap, write_mcap

pytest.importorskip("mcap_protobuf")

FAULTS = [
    {"at_s": 0.15, "kind": "part", "groups": [[0, 1], [2, 3]]},
    {"at_s": 0.4, "kind": "heal"},
    {"at_s": 0.6, "kind": "kill", "agents": [1]},
]


def flown(**fields: Any) -> Recorded:
    flight = rs.simulate(rs.mission(fly_s=1.0, **fields))
    report = flight.report
    return Recorded(flight.mission, flight.trajectory, end_told(report), report.tau_s, report)


def messages(path: Path, topic: str) -> list[tuple[float, Any]]:
    """Time [s] and content of all messages of a topic."""
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory

    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        read = []
        for schema, channel, message in reader.iter_messages(topics=[topic]):
            assert schema is not None
            decode = DecoderFactory().decoder_for(channel.message_encoding, schema)
            content = decode(message.data) if decode else json.loads(message.data)
            if not decode:
                assert set(content) <= set(json.loads(schema.data)["properties"])
            read.append((message.log_time / 1e9, content))
        return read


@pytest.fixture(scope="module")
def flight() -> Recorded:
    return flown(agents=4, obstacles={"discs": [[20, 0, 1.5], [25, 4, 1]]}, faults=FAULTS)


@pytest.fixture(scope="module")
def written(flight: Recorded, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mcap") / "flight.mcap"
    write_mcap(flight, path)
    return path


def test_what_foxglove_has_a_schema_for_has_it(written: Path) -> None:
    from mcap.reader import make_reader

    with written.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        (attachment,) = reader.iter_attachments()
    assert summary is not None
    schemas = {
        channel.topic: (summary.schemas[channel.schema_id].name, channel.message_encoding)
        for channel in summary.channels.values()
    }
    assert schemas == {
        "/poses": ("foxglove.PosesInFrame", "protobuf"),
        "/tf": ("foxglove.FrameTransforms", "protobuf"),
        "/scene": ("foxglove.SceneUpdate", "protobuf"),
        "/log": ("foxglove.Log", "protobuf"),
        "/events": ("rsc_swarm.Event", "json"),
        "/drones": ("rsc_swarm.Drones", "json"),
        "/figures": ("rsc_swarm.Figures", "json"),
        "/links": ("rsc_swarm.Links", "json"),
        "/report": ("rsc_swarm.FlightReport", "json"),
    }
    assert attachment.name == "mission.yaml"


def test_every_drone_is_where_it_was(flight: Recorded, written: Path) -> None:
    for time_s, seen in messages(written, "/poses"):
        there = [(pose.position.x, pose.position.y) for pose in seen.poses]
        np.testing.assert_array_equal(there, flight.path.positions[round(time_s * 100)])
    times = [time_s for time_s, _ in messages(written, "/tf")]
    np.testing.assert_allclose(np.diff(times), 0.05)
    first = messages(written, "/tf")[0][1].transforms
    assert [(each.parent_frame_id, each.child_frame_id) for each in first] == [
        ("mission", f"drone_{agent}") for agent in range(4)
    ]


def test_the_scene_has_the_field_the_drones_that_fly_the_tree_and_the_radio(
    flight: Recorded, written: Path
) -> None:
    (_, first), *later = messages(written, "/scene")
    field, *_ = first.entities
    assert [text.text for text in field.texts] == ["obstacle 0", "obstacle 1"]
    assert [cylinder.size.x for cylinder in field.cylinders] == [3.0, 2.0]
    numbers = {
        time_s: [text.text for text in scene.entities[0].texts] for time_s, scene in later
    }  # in later ones the drones come first
    assert numbers[0.5] == ["0", "1", "2", "3"]
    assert numbers[0.9] == ["0", "2", "3"]
    links = {time_s: [len(line.points) // 2 for line in scene.entities[2].lines] for time_s, scene in later}
    together, apart = [(0, 1), (2, 3)], [(0, 2), (0, 3), (1, 2), (1, 3)]

    def near(row: int, pairs: list[tuple[int, int]]) -> int:
        at = flight.path.positions[row]
        return sum(bool(np.linalg.norm(at[a] - at[b]) <= 6.0) for a, b in pairs)

    assert links[0.4] == [near(40, together)], "while it is parted, only those of a group hear each other"
    assert links[0.6] == [near(60, together + apart)]
    assert links[0.6][0] > links[0.4][0]


def test_links_are_what_the_radio_carried_and_lost_and_the_scene_draws_them(written: Path) -> None:
    links = {time_s: content["links"] for time_s, content in messages(written, "/links")}
    assert links[0.0] == []
    heard = {frozenset((link["source"], link["destination"])) for link in links[0.4] if link["carried"]}
    assert heard == {frozenset((0, 1))}, "the radio is parted, and 2 and 3 are out of each other's range"
    assert all(1 not in (link["source"], link["destination"]) for link in links[0.9]), "it is dead"
    lost = {frozenset((link["source"], link["destination"])) for link in links[0.4] if link["lost"]}
    assert lost
    assert all(len(pair & {0, 1}) == 1 for pair in lost), "between those that are parted"
    assert not any(link["delayed"] for each in links.values() for link in each)


def test_where_a_flight_does_not_repeat_links_are_who_could_hear_whom(
    flight: Recorded, tmp_path: Path
) -> None:
    assert flight.report
    by_clock = replace(flight, report=flight.report.model_copy(update={"clock": "realtime"}))
    another = replace(flight, report=flight.report.model_copy(update={"digest": "0" * 32}))
    for name, recorded in (("clock", by_clock), ("another", another)):
        write_mcap(recorded, tmp_path / name)
        assert messages(tmp_path / name, "/links") == []
        radio = dict(messages(tmp_path / name, "/scene"))[0.5].entities[2]
        assert len(radio.lines[0].points) > 0


def test_events_and_the_report_are_those_of_the_flight(flight: Recorded, written: Path) -> None:
    told = [content["text"] for _, content in messages(written, "/events")]
    assert told == [event.text for event in flight.events]
    log = messages(written, "/log")
    assert [(time_s, line.name) for time_s, line in log] == [
        (event.time_s, event.what) for event in flight.events
    ]
    assert [line.level for _, line in log if line.name == "kill"] == [4]
    ((time_s, report),) = messages(written, "/report")
    assert (time_s, report["digest"]) == (1.0, flight.report.digest)  # type: ignore[union-attr]


def test_of_one_drone_in_an_empty_field_a_file_is_made_too(tmp_path: Path) -> None:
    write_mcap(flown(agents=1, obstacles={"discs": []}), tmp_path / "one.mcap")
    assert all(content["nearest_m"] is None for _, content in messages(tmp_path / "one.mcap", "/figures"))


def test_a_flight_is_written_right_after_it_was_flown(tmp_path: Path) -> None:
    from rsc_swarm.cli.app import FlightOptions
    from rsc_swarm.cli.simulate import _fly
    from rsc_swarm.options import MissionOptions

    out = tmp_path / "new.mcap"
    fly_once("simulate", _fly, FlightOptions(mcap=out), MissionOptions(agents=2, set=["fly_s=0.1"]))
    assert messages(out, "/report")[0][1]["agents"] == 2
    with pytest.raises(
        SwarmError, match=r"^--mcap .*nowhere/x.mcap: give a file in a directory that exists$"
    ):
        fly_once("simulate", _fly, FlightOptions(mcap=tmp_path / "nowhere" / "x.mcap"), MissionOptions())


def test_without_the_extra_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mcap_file, "find_spec", lambda name: None)
    with pytest.raises(McapError, match="pip install mcap mcap-protobuf-support foxglove-schemas-protobuf"):
        check_mcap()
