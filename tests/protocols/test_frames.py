"""Frames: what is written is what is read, and nothing that is not a frame is ever believed."""

from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols.slots.agreement import SlotNote, decode, encode
from protocols.wire.frames import (
    FIXED,
    MAX_FRAME_BYTES,
    MAX_KNOWN,
    OBSERVATION_SIZE,
    REASONS,
    VERSION,
    FrameCodec,
    FrameError,
    Frames,
    empty_frames,
    fault,
    swarm_tag,
)

AGENTS = 25
TAG = swarm_tag("rsc")
NOW, OLDEST = 1000, 200
NOTE = SlotNote(0x1234567890ABCDEF, settled=True)


def drawn(seed: int, count: int = 5) -> Frames:
    """One row of a frame such as a drone might send at tick NOW - 1, knowing ``count`` drones."""
    draw = np.random.default_rng(seed)
    frames = empty_frames(1)
    frames.tick[0] = NOW - 1
    frames.motion[0] = draw.normal(0, 20, 4)
    frames.observation[0] = draw.integers(-32768, 32768, OBSERVATION_SIZE)
    frames.ages[0] = draw.integers(0, 256, 8)
    frames.sender[0], frames.slot[0], frames.age_from[0] = draw.integers(0, AGENTS, 3)
    frames.known_count[0] = count
    frames.one_hop[0] = draw.integers(0, count + 1)
    frames.known[0, :count] = draw.integers(0, AGENTS, count)
    frames.displacement[0, :count] = draw.normal(0, 6, (count, 2))
    return frames


def good(seed: int = 0, count: int = 5, note: SlotNote = NOTE) -> bytes:
    return FrameCodec(TAG, drawn(seed, count)).encode(0, encode(note))


def reason(data: bytes, now: int = NOW) -> str | None:
    """Why ``data`` is not believed; None if it is."""
    frames = empty_frames(2)
    try:
        FrameCodec(TAG, frames).decode(data, 1)
    except FrameError as error:
        return REASONS[REASONS.index(error.reason)]
    number = fault(frames, 1, now, OLDEST, AGENTS)
    return None if number < 0 else REASONS[number]


def altered(place: int, value: Any) -> bytes:
    """A good frame of which one of the six parts has been replaced."""
    parts = msgpack.unpackb(good())
    parts[place] = value
    packed: bytes = msgpack.packb(parts)
    return packed


def with_field(name: str, value: Any) -> bytes:
    frames = drawn(0)
    frames.fixed[0][name] = value
    return FrameCodec(TAG, frames).encode(0, encode(NOTE))


@given(seed=st.integers(0, 2**32), count=st.integers(0, MAX_KNOWN))
def test_what_is_written_is_what_is_read(seed: int, count: int) -> None:
    sent, heard = drawn(seed, count), empty_frames(4)
    sender, note = FrameCodec(TAG, heard).decode(FrameCodec(TAG, sent).encode(0, encode(NOTE)), 2)
    assert (sender, decode(note, AGENTS)) == (sent.sender[0], NOTE)
    assert heard.fixed[2] == sent.fixed[0]
    assert heard.known[2, :count].tolist() == sent.known[0, :count].tolist()
    assert heard.displacement[2, :count].tobytes() == sent.displacement[0, :count].tobytes()
    # The rows around it are untouched.
    assert not heard.fixed[[0, 1, 3]].view(np.uint8).any()
    assert not heard.known[[0, 1, 3]].any()


def test_the_views_of_a_row_are_its_record() -> None:
    frames = drawn(1)
    for name in FIXED.names or ():
        assert np.array_equal(getattr(frames, name)[0], frames.fixed[0][name])


def test_the_fullest_frame_fits_the_limit() -> None:
    # 200 bytes are left for a loud slot note.
    assert len(good(count=MAX_KNOWN)) <= MAX_FRAME_BYTES - 200


def test_a_frame_of_nine_bytes_per_known_drone_stays_small() -> None:
    assert len(good(count=12)) <= 250


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (bytes(MAX_FRAME_BYTES + 1), "oversized"),
        (b"", "malformed"),
        (b"\xc1", "malformed"),
        (good()[:-1], "malformed"),
        (good() + b"\x00", "malformed"),
        (msgpack.packb(list(range(5))), "malformed"),
        (msgpack.packb({"a": 1}), "malformed"),
        (altered(0, VERSION + 1), "version"),
        (altered(0, "1"), "version"),
        (altered(1, TAG ^ 1), "foreign"),
        (altered(1, None), "foreign"),
        (altered(2, b"short"), "malformed"),
        (altered(2, None), "malformed"),
        (altered(3, b"\x00" * 4), "malformed"),
        (altered(3, 5), "malformed"),
        (altered(3, None), "malformed"),
        (altered(3, [0, 1, 2, 3, 4]), "malformed"),
        (altered(3, bytes([AGENTS] * 5)), "sender"),
        (altered(4, b"\x00" * 39), "malformed"),
        (altered(4, b"\x00" * 32), "malformed"),
        (altered(4, "x" * 40), "malformed"),
        (altered(4, None), "malformed"),
        (altered(4, np.full(10, np.nan, np.float32).tobytes()), "non-finite"),
        (altered(4, np.array([np.inf, -np.inf] * 5, np.float32).tobytes()), "non-finite"),
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
    assert reason(FrameCodec(swarm_tag("other"), drawn(0)).encode(0, encode(NOTE))) == "foreign"


@given(data=st.binary(max_size=1200))
def test_random_bytes_are_never_believed_and_never_crash(data: bytes) -> None:
    assert reason(data) is not None


NUMBERS = st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats()
ANYTHING = st.recursive(
    NUMBERS | st.binary(max_size=80) | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=6) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
)


@given(place=st.integers(0, 4), value=ANYTHING)
def test_a_frame_with_a_part_of_any_type_never_crashes(place: int, value: Any) -> None:
    reason(altered(place, value))


@given(value=ANYTHING)
def test_any_message_that_is_no_frame_never_crashes(value: Any) -> None:
    assert reason(msgpack.packb(value)) is not None


@given(seed=st.integers(0, 99), at=st.integers(0, 10_000), flip=st.integers(1, 255))
def test_a_good_frame_with_one_byte_changed_never_crashes(seed: int, at: int, flip: int) -> None:
    data = bytearray(good(seed))
    data[at % len(data)] ^= flip
    reason(bytes(data))
