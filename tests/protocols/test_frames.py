"""Frames: what is written is what is read, and nothing that is not a frame is ever believed."""

from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent.ports import Heard, heard_of
from agent.radio.air import Air
from agent.radio.hearing import Hearing
from protocols.slots.agreement import SlotNote, encode
from protocols.wire.frames import (
    FIXED,
    MAX_FRAME_BYTES,
    MAX_KNOWN,
    OBSERVATION_SIZE,
    RELAYED,
    RELAYING,
    VERSION,
    Frames,
    FrameWriter,
    altered,
    empty_frames,
    swarm_tag,
)
from protocols.wire.heard import pack_heard

AGENTS = 25
TAG = swarm_tag("rsc")
NOW, OLDEST = 1000, 200


def drawn(seed: int, count: int = 5, relays: bool = False) -> Frames:
    """One row of a frame such as a drone might send at tick NOW - 1, knowing ``count`` drones."""
    draw = np.random.default_rng(seed)
    frames = empty_frames(1, TAG)
    frames.tick[0] = NOW - 1
    frames.motion[0] = draw.normal(0, 20, 4)
    frames.observation[0] = draw.integers(-32768, 32768, OBSERVATION_SIZE)
    frames.ages[0] = draw.integers(0, 256, 8)
    frames.sender[0], frames.slot[0], frames.age_from[0] = draw.integers(0, AGENTS, 3)
    frames.known_count[0] = count
    frames.one_hop[0] = draw.integers(0, count + 1)
    frames.known[0, :count] = draw.integers(0, AGENTS, count)
    frames.displacement[0, :count] = draw.normal(0, 6, (count, 2))
    frames.version[0] = RELAYING if relays else VERSION
    frames.relayed[0] = draw.integers(-32768, 32768, (RELAYED, OBSERVATION_SIZE))
    return frames


def good(seed: int = 0, count: int = 5, note: bytes = b"", tag: int = TAG, relays: bool = False) -> bytes:
    frames = drawn(seed, count, relays)
    frames.loud[0], frames.tag[0] = note != b"", tag
    return FrameWriter(frames).write(0, note)


NOTE: bytes = msgpack.packb(encode(SlotNote(0x1234567890ABCDEF, settled=False)))


class Listener:
    """Drone `AGENTS`, which is not of the swarm and so hears all of it, at tick ``now``."""

    def __init__(self) -> None:
        self.air = Air("rsc", AGENTS, 4)
        self.ears = Hearing(self.air, AGENTS, AGENTS)

    def hear(self, *frames: bytes, now: int = NOW) -> list[str]:
        """Why those that are not believed are not."""
        said = [(source_of(frame), frame) for frame in frames]
        self.believed = self.ears.believed[: self.ears.hear(now, heard_of(said))].tolist()
        return [reason for reason, count in self.ears.rejected.items() for _ in range(count)]


def source_of(frame: bytes) -> int:
    place = FIXED.fields["sender"][1]
    return int.from_bytes(frame[place : place + 2], "little")


def reason(data: bytes, now: int = NOW) -> str | None:
    """Why ``data`` is not believed; None if it is."""
    listener = Listener()
    reasons = listener.hear(data, now=now)
    assert len(listener.believed) + len(reasons) == 1
    return reasons[0] if reasons else None


def with_field(name: str, value: Any, note: bytes = b"") -> bytes:
    data = good(note=note)
    record = np.frombuffer(data, FIXED, 1).copy()
    record[name] = value
    return record.tobytes() + data[FIXED.itemsize :]


@given(seed=st.integers(0, 2**32), count=st.integers(0, MAX_KNOWN), relays=st.booleans())
def test_what_is_written_is_what_is_read(seed: int, count: int, relays: bool) -> None:
    sent, listener = drawn(seed, count, relays), Listener()
    sent.loud[0] = 1
    heard = listener.air.frames
    before = heard.fixed_bytes[[0, 2, 3]].copy()
    assert listener.hear(FrameWriter(sent).write(0, NOTE)[:-1], FrameWriter(sent).write(0, NOTE)) == [
        "malformed"
    ]
    (row,) = listener.believed
    assert listener.air.note(row) == SlotNote(0x1234567890ABCDEF, settled=False)
    sent.digest[0] = heard.digest[row]
    assert heard.fixed[row] == sent.fixed[0]
    assert heard.known[row, :count].tolist() == sent.known[0, :count].tolist()
    assert heard.displacement[row, :count].tobytes() == sent.displacement[0, :count].tobytes()
    assert np.array_equal(heard.relayed[row], sent.relayed[0]) == relays
    # The rows after it are untouched.
    assert np.array_equal(heard.fixed_bytes[[2, 3]], before[1:])
    assert not heard.known[[2, 3]].any()


def test_the_views_of_a_row_are_its_record() -> None:
    frames = drawn(1)
    for name in FIXED.names or ():
        assert np.array_equal(getattr(frames, name)[0], frames.fixed[0][name])


def test_the_fullest_frame_fits_the_limit() -> None:
    # 200 bytes are left for a loud slot note.
    assert len(good(count=MAX_KNOWN, relays=True)) <= MAX_FRAME_BYTES - 200


def test_a_frame_of_ten_bytes_per_known_drone_stays_small() -> None:
    assert len(good(count=12)) <= 250


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (bytes(MAX_FRAME_BYTES + 1), "oversized"),
        (b"", "malformed"),
        (b"\xc1", "malformed"),
        (good()[: FIXED.itemsize - 1], "malformed"),
        (good()[:-1], "malformed"),
        (good() + b"\x00", "malformed"),
        (altered(good(), known=b"\x00" * 9), "malformed"),
        (altered(good(), displacement=b"\x00" * 41), "malformed"),
        (with_field("loud", 1), "malformed"),
        (with_field("loud", 2, NOTE), "malformed"),
        (with_field("loud", 0, NOTE), "malformed"),
        (with_field("known_count", MAX_KNOWN + 1), "malformed"),
        (with_field("known_count", 4), "malformed"),
        (with_field("known_count", 6), "malformed"),
        (altered(good(), note=b"\xc1"), "malformed"),
        (altered(good(), note=NOTE[:-1]), "malformed"),
        (altered(good(), note=NOTE + b"\x00"), "malformed"),
        (altered(good(), note=msgpack.packb(5)), "malformed"),
        (altered(good(), note=NOTE), None),
        (with_field("version", RELAYING + 1), "version"),
        (with_field("version", RELAYING), "malformed"),
        (good(relays=True), None),
        (good(relays=True)[:-1], "malformed"),
        (altered(good(relays=True), note=NOTE), None),
        (altered(good(relays=True), relayed=b""), "malformed"),
        (with_field("tag", TAG ^ 1), "foreign"),
        (altered(good(), known=np.full(5, AGENTS, np.uint16).tobytes()), "sender"),
        (altered(good(), known=np.full(5, 65535, np.uint16).tobytes()), "sender"),
        (altered(good(), displacement=np.full(10, np.nan, np.float32).tobytes()), "non-finite"),
        (altered(good(), displacement=np.array([np.inf, -np.inf] * 5, np.float32).tobytes()), "non-finite"),
        (with_field("motion", (1.0, np.nan, 0.0, 0.0)), "non-finite"),
        (with_field("motion", (1.0, np.inf, 0.0, 0.0)), "non-finite"),
        (with_field("sender", AGENTS), "sender"),
        (with_field("slot", AGENTS), "malformed"),
        (with_field("age_from", AGENTS), "malformed"),
        (with_field("one_hop", 6), "malformed"),
        (with_field("tick", NOW), "stale"),
        (with_field("tick", NOW + 5), "stale"),
        (with_field("tick", NOW - OLDEST - 1), "stale"),
        (with_field("tick", NOW - OLDEST), None),
        (good(), None),
    ],
)
def test_a_frame_is_refused_for_its_own_reason(data: bytes, why: str | None) -> None:
    assert reason(data) == why


def test_another_swarm_on_the_same_air_is_not_heard() -> None:
    assert reason(good(tag=swarm_tag("other"))) == "foreign"


def test_a_bad_frame_between_good_ones_takes_nothing_from_them() -> None:
    listener, bad = Listener(), with_field("version", 9)
    assert listener.hear(good(1), bad, good(2), b"", good(3)) == ["malformed", "version"]
    senders = listener.air.frames.sender[listener.believed].tolist()
    assert senders == [source_of(good(seed)) for seed in (1, 2, 3)]


def test_an_entry_that_is_not_whole_ends_what_is_heard() -> None:
    listener, entries = Listener(), pack_heard([(source_of(good()), good())] * 2)
    for size in (len(entries) - 1, len(entries) // 2 + 3, len(entries) // 2 + 1):
        data = np.frombuffer(entries[:size], np.uint8)
        assert listener.ears.hear(NOW, Heard(data, 0, size, 2)) == 1
    assert listener.ears.rejected["malformed"] == 3


def test_a_frame_in_anothers_name_is_not_believed() -> None:
    ears = Hearing(Air("rsc", AGENTS, 2), AGENTS, AGENTS)
    assert ears.hear(NOW, heard_of([(source_of(good()) + 1, good())])) == 0
    assert ears.rejected["sender"] == 1


@given(data=st.binary(max_size=1200))
def test_random_bytes_are_never_believed_and_never_crash(data: bytes) -> None:
    assert reason(data) is not None


NUMBERS = st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats()
ANYTHING = st.recursive(
    NUMBERS | st.binary(max_size=80) | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=6) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
)


@given(value=ANYTHING)
def test_a_frame_with_any_note_never_crashes(value: Any) -> None:
    reason(altered(good(), note=msgpack.packb(value)))


@given(seed=st.integers(0, 99), at=st.integers(0, 10_000), flip=st.integers(1, 255))
def test_a_good_frame_with_one_byte_changed_never_crashes(seed: int, at: int, flip: int) -> None:
    data = bytearray(good(seed))
    data[at % len(data)] ^= flip
    reason(bytes(data))
