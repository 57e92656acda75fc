"""Frames that a drone hears: bad ones are counted, change nothing, and take nothing from good ones."""

from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocols.mission.document import parse_mission
from protocols.wire.frames import FIXED, MAX_FRAME_BYTES, REASONS, RELAYING, altered, swarm_tag
from protocols.wire.messages import (
    make_tick,
)
from tests import loopback
from tests.agent.drones import (
    GOOD,
    ME,
    MISSION,
    NOW,
    WELCOME,
    answers,
    drone,
    from_others,
    reply,
    sensed,
    ticked,
)
from tests.loopback import Hosted

DEAF = answers([])[0]


def test_a_frame_in_anothers_name_is_dropped() -> None:
    sources, heard = from_others(GOOD)
    one = drone()
    one.answer(make_tick(NOW, 0, NOW - 1, sensed(), [source + 1 for source in sources], heard))
    assert one.drone.rejected["sender"] == len(heard)


def noted(note: object, data: bytes = GOOD[0]) -> bytes:
    """A frame that says this of slots."""
    return altered(data, note=msgpack.packb(note))


def patched(name: str, value: Any, data: bytes = GOOD[0]) -> bytes:
    """A frame of which one field of the record is replaced."""
    record = np.frombuffer(data, FIXED, 1).copy()
    record[name] = value
    return record.tobytes() + data[FIXED.itemsize :]


def rejected(**counts: int) -> dict[str, int]:
    return {**dict.fromkeys(REASONS, 0), **counts}


def test_good_frames_are_believed() -> None:
    said, counts = answers(GOOD)
    assert said != DEAF
    assert counts == rejected()


def nested(deep: int) -> list[Any]:
    """[[[...]]], so deep that Python's own way to print it gives up."""
    return [nested(deep - 1)] if deep else []


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "malformed"),
        (b"\xc1 no frame", "malformed"),
        (bytes(MAX_FRAME_BYTES + 1), "oversized"),
        (patched("version", RELAYING + 1), "version"),
        (patched("tag", swarm_tag("other")), "foreign"),
        (GOOD[0][: FIXED.itemsize + 1], "malformed"),
        (patched("loud", 1, altered(GOOD[0], note=b"")), "malformed"),
        (altered(GOOD[0], note=b"\xc1"), "malformed"),
        (noted(None), "malformed"),
        (noted([1]), "malformed"),
        (noted([-1, 1]), "malformed"),
        (noted([1, 2]), "malformed"),
        (noted(nested(900)), "malformed"),
        (noted([nested(900), 1]), "malformed"),
        (noted([1, 1, 0, [0, 1, 2, 2], None, [], None, [], [], None]), "malformed"),
        (noted([1, 1, 0, None, None, [], None, [], [], [bytes(6), 1, 1, 1]]), "malformed"),
        (patched("motion", (np.nan, 0, 0, 0)), "non-finite"),
        (patched("sender", ME), "sender"),
    ],
)
def test_a_bad_frame_is_counted_by_its_reason_and_as_good_as_unheard(data: bytes, reason: str) -> None:
    assert answers([data]) == (DEAF, rejected(**{reason: 1}))


@pytest.mark.parametrize("error", [RecursionError, MemoryError, KeyError, OverflowError])
def test_whatever_reading_one_frame_ends_in_costs_that_frame_alone(
    monkeypatch: pytest.MonkeyPatch, error: type[Exception]
) -> None:
    def fail(encoded: object, agents: int) -> None:
        raise error

    monkeypatch.setattr("agent.radio.air.decode", fail)
    loud = noted([1, 0])
    assert answers([loud]) == (DEAF, rejected(malformed=1))


def test_a_frame_from_the_past_or_the_future_is_stale() -> None:
    late = drone()
    late.answer(ticked(NOW + 500, GOOD))
    early = drone()
    early.answer(ticked(NOW - 1, GOOD))
    assert late.drone.rejected == early.drone.rejected == rejected(stale=5)


def test_bad_frames_between_good_ones_take_nothing_from_them() -> None:
    mixed = [b"", GOOD[0], noted(None), GOOD[1], bytes(2000), *GOOD[2:], patched("sender", ME)]
    said, counts = answers(mixed)
    assert said == answers(GOOD)[0]
    assert counts == rejected(malformed=2, oversized=1, sender=1)


@given(garbage=st.lists(st.binary(max_size=1100), max_size=8))
def test_random_bytes_leave_a_drone_as_it_was(garbage: list[bytes]) -> None:
    said, counts = answers(garbage)
    assert said == DEAF
    assert sum(counts.values()) == len(garbage)


NUMBERS = st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats()


ANYTHING = st.recursive(
    NUMBERS | st.binary(max_size=60) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=11),
    max_leaves=15,
)  # fmt: skip


@settings(max_examples=60)
@given(which=st.integers(0, len(GOOD) - 1), value=ANYTHING)
def test_a_good_frame_with_any_note_is_no_crash(which: int, value: Any) -> None:
    said, counts = answers([noted(value, GOOD[which])])
    assert sum(counts.values()) == 0 or said == DEAF


@settings(max_examples=60)
@given(which=st.integers(0, len(GOOD) - 1), at=st.integers(0, 4000), flip=st.integers(1, 255))
def test_a_good_frame_with_one_byte_changed_is_believed_or_as_good_as_unheard(
    which: int, at: int, flip: int
) -> None:
    data = bytearray(GOOD[which])
    data[at % len(data)] ^= flip
    said, counts = answers([bytes(data)])
    assert sum(counts.values()) == 0 or said == DEAF
    assert all(np.isfinite(answer.ax) for answer in said)


NOTES = st.tuples(
    st.integers(0, 2**64 - 1), st.integers(0, 1), st.integers(0, 1),
    st.none() | st.lists(st.integers(0, 6), min_size=4, max_size=4),
    st.none() | st.lists(st.integers(0, 6), min_size=3, max_size=3),
    st.lists(st.lists(st.integers(0, 6), min_size=2, max_size=2), max_size=3),
    st.none() | st.lists(st.integers(0, 6), min_size=2, max_size=2),
    st.lists(st.lists(st.integers(0, 5), min_size=7, max_size=7), max_size=4),
    st.lists(st.lists(st.integers(0, 5), min_size=5, max_size=5), max_size=4),
    st.none() | st.permutations(range(6)).map(lambda view: [bytes(view), 5, 3, 2]),
)  # fmt: skip


@settings(max_examples=60)
@given(notes=st.lists(NOTES, min_size=1, max_size=5))
def test_whatever_neighbours_say_about_slots_a_drone_goes_on_and_holds_one(notes: list[Any]) -> None:
    one = drone()
    heard = [noted(note, frame) for note, frame in zip(notes, GOOD, strict=False)]
    one.answer(ticked(NOW, heard))
    assert 0 <= reply(one.answer(ticked(NOW + 1, []))).slot < 6
    assert sorted(one.drone.status().view) == list(range(6))


def test_a_steady_formation_of_twenty_five_speaks_in_at_most_250_bytes() -> None:
    steady = parse_mission({"start": {"radius_m": 0}, "obstacles": {"discs": []}, "fly_s": 1.5})
    assert loopback.fly(steady).median_frame_bytes <= 250


def test_a_drone_that_begins_in_mid_flight_takes_nobody_for_dead() -> None:
    one = Hosted(MISSION, ME, WELCOME._replace(boot=1))
    one.answer(ticked(900, []))
    assert one.drone._core._memory.last_seen[0].tolist() == [900] * 6
