"""Messages between the world and a drone: read as written, or refused."""

import tracemalloc
from typing import Any

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols.wire import messages, pieces
from protocols.wire.frames import MAX_FRAME_BYTES
from protocols.wire.messages import (
    Bye,
    Farewell,
    Hello,
    MessageError,
    Ready,
    Refused,
    Reply,
    Wait,
    Welcome,
    make_tick,
)
from protocols.wire.planned import PLAN_BYTES
from protocols.wire.sensed import MAX_NEAR, MAX_OBSTACLES, SensedPacker, SensedReader, empty_sensed
from protocols.wire.status import SWAP_COUNTS, AgentStatus, parse_status

STATUS = AgentStatus(3, 4, (0,) * 7, (0,) * len(SWAP_COUNTS), 99, bytes(range(6)))


FROM_DRONE = [
    Hello(messages.VERSION, 7),
    Ready(messages.MAX_PROCESS),
    Reply(7, 3, 9, 0.5, -0.5, 5, b"frame", None),
    Reply(7, 0, 9, 0.0, 0.0, 0, None, STATUS),
    Reply(7, 0, 9, 0.0, 0.0, 0, b"frame", STATUS, bytes(PLAN_BYTES)),
    Farewell(7, STATUS),
]
FROM_WORLD = [
    Welcome(7, {"agents": 6}, bytes(6), 1, bytes(8), bytes(32), True),
    make_tick(3, 9, 2, (bytes(32), bytes(40), b""), [1], [b"frame"]),
    Wait(),
    Bye(),
    Refused(7, "no"),
]


@pytest.mark.parametrize("message", FROM_DRONE)
def test_what_a_drone_says_is_read_as_it_was_written(message: messages.FromDrone) -> None:
    assert messages.unpack_from_drone(messages.pack(message), 6) == message
    with pytest.raises(MessageError):
        messages.unpack_from_world(messages.pack(message))


@pytest.mark.parametrize("message", FROM_WORLD)
def test_what_the_world_says_is_read_as_it_was_written(message: messages.FromWorld) -> None:
    read = messages.unpack_from_world(messages.pack(message))
    assert type(read) is type(message)
    assert messages.pack(read) == messages.pack(message)
    with pytest.raises(MessageError):
        messages.unpack_from_drone(messages.pack(message), 6)


REPLY = messages.pack(Reply(7, 3, 9, 0.5, -0.5, 5, b"frame", None))


def deep(levels: int) -> bytes:
    return b"\x91" * levels + b"\x01"


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xc1",
        b"\x93\x01",
        msgpack.packb(5),
        msgpack.packb([]),
        msgpack.packb([99]),
        msgpack.packb([True]),
        msgpack.packb(["hi"]),
        deep(400),
        deep(1000),
        deep(60_000),
        bytes(70_000),
        messages.pack(Hello(messages.VERSION, 2**32)),
        b"R",
        REPLY[:-1],
        REPLY + b"\x00",
        messages.pack(Reply(7, 3, 9, 1e9, 0.0, 5, None, None)),
        messages.pack(Reply(7, 3, 9, float("nan"), 0.0, 5, None, None)),
        messages.pack(Reply(7, 3, 9, 0.0, float("-inf"), 5, None, None)),
        messages.pack(Reply(7, 3, 9, 0.0, 0.0, 6, None, None)),
        messages.pack(Reply(7, 2**31, 9, 0.0, 0.0, 5, None, None)),
        messages.pack(Reply(7, 3, 9, 0.0, 0.0, 5, None, STATUS._replace(slot=-1))),
        messages.pack(Reply(7, 3, 9, 0.0, 0.0, 5, None, 5)),  # type: ignore[arg-type]
        messages.pack(Reply(7, 3, 9, 0.0, 0.0, 5, None, None, bytes(PLAN_BYTES - 1))),
        messages.pack(Farewell(7, STATUS._replace(view=b"short"))),
    ],
)
def test_what_is_no_message_is_refused(data: bytes) -> None:
    with pytest.raises(MessageError):
        messages.unpack_from_drone(data, 6)
    if len(data) < 12:
        with pytest.raises(MessageError):
            messages.unpack_from_world(data)


@given(data=st.binary(max_size=200))
def test_random_bytes_are_a_message_or_refused(data: bytes) -> None:
    for unpack in (lambda data: messages.unpack_from_drone(data, 6), messages.unpack_from_world):
        try:
            unpack(data)
        except MessageError:
            continue


def test_a_frame_that_is_too_long_goes_no_further_and_the_answer_counts() -> None:
    said = messages.unpack_from_drone(
        messages.pack(Reply(7, 3, 9, 0.5, 0.0, 5, bytes(MAX_FRAME_BYTES + 1), None)), 6
    )
    assert said == Reply(7, 3, 9, 0.5, 0.0, 5, None, None)


def test_the_longest_that_an_honest_drone_says_is_taken_in() -> None:
    most = 2**64 - 1
    account = AgentStatus(249, 249, (most,) * 7, (most,) * len(SWAP_COUNTS), most, bytes(250))
    longest = Reply(
        messages.MAX_PROCESS,
        messages.MAX_TICK,
        messages.MAX_PROOF,
        0.5,
        -0.5,
        249,
        bytes(MAX_FRAME_BYTES),
        account,
    )
    assert messages.unpack_from_drone(messages.pack(longest), 250) == longest


BOMBS = {
    "a byte string of four gigabytes": b"\x98\x02\xc6\xff\xff\xff\xff",
    "a list of four milliards": b"\xdd\xff\xff\xff\xff",
    "lists of thousands in lists of thousands": b"\xdc\x0f\xff" * 1300,
    "a map": msgpack.packb([2, {1: 2}]),
    "text": msgpack.packb([2, "a" * 1000]),
    "an extension": msgpack.packb([2, msgpack.ExtType(5, b"x")]),
    "a time stamp": msgpack.packb([2, msgpack.Timestamp(2**40, 5)]),
    "a million small things": msgpack.packb([0] * 1_000_000),
}


@pytest.mark.parametrize("data", BOMBS.values(), ids=BOMBS.keys())
def test_a_message_made_to_swell_is_refused_before_it_does(data: bytes) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(MessageError):
            messages.unpack_from_drone(data, 6)
        assert tracemalloc.get_traced_memory()[1] < 200_000
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("length", [0, 1, 59_999, 60_000, 60_001, 119_998, 119_999, 500_000])
@pytest.mark.parametrize("begins", [b"\x00", b"\x01", b"\x95"])
def test_a_message_of_any_length_is_cut_and_joined_again(length: int, begins: bytes) -> None:
    message, joiner = (begins * length)[:length], pieces.Joiner()
    cut = list(pieces.cut(message, 7))
    assert max(map(len, cut)) <= pieces.LONGEST
    assert [whole for piece in cut if (whole := joiner.join(piece)) is not None] == [message]


@given(st.permutations(range(9)), st.sets(st.integers(0, 8)), st.lists(st.binary(max_size=30), max_size=3))
def test_pieces_that_come_out_of_order_or_not_at_all_make_no_message_that_was_never_sent(
    order: list[int], lost: set[int], strange: list[bytes]
) -> None:
    said = [bytes([0x90 + number]) * 250 for number in range(3)]
    cut = [piece for number, message in enumerate(said) for piece in pieces.cut(message, number, 100)]
    assert len(cut) == 9
    joiner = pieces.Joiner()
    for piece in strange:
        joiner.join(b"\x00" + piece)
    got = [joiner.join(cut[place]) for place in order if place not in lost]
    whole = [number for number in range(3) if not lost & {3 * number, 3 * number + 1, 3 * number + 2}]
    assert sorted(message for message in got if message is not None) == [said[number] for number in whole]


def test_a_piece_beyond_the_last_is_none_and_one_that_comes_often_counts_once() -> None:
    message = bytes(400)
    first, *rest = pieces.cut(message, 7, 100)
    count = 1 + len(rest)
    beyond = first[:5] + count.to_bytes(2, "little") + first[7:]
    joiner = pieces.Joiner(longest=600)
    for piece in (beyond, *[first] * 20, *rest[:-1]):
        assert joiner.join(piece) is None
    assert joiner.join(rest[-1]) == message


def test_messages_that_never_become_whole_are_not_kept() -> None:
    joiner = pieces.Joiner()
    for number in range(1000):
        joiner.join(next(pieces.cut(bytes(1000), number, 100)))
    assert len(joiner._open) <= 4


def test_what_a_drone_senses_and_hears_of_a_hundred_drones_travels_in_pieces() -> None:
    crowd = make_tick(
        0, 9, -1, (bytes(32), bytes(40 * MAX_NEAR), bytes(24)), bytes(96), [bytes(MAX_FRAME_BYTES)] * 96
    )
    cut = list(pieces.cut(messages.pack(crowd), 2**32 + 5))
    assert len(cut) == 6
    assert all(len(piece) < 65_535 for piece in cut)


def test_a_world_tells_its_drones_that_it_lives_before_they_give_up() -> None:
    assert messages.WAIT_EVERY_S * 3 < messages.SILENCE_LIMIT_S


def test_what_is_sensed_survives_the_wire() -> None:
    sent, heard = empty_sensed(3), empty_sensed(1)
    sent.position[2], sent.velocity[2] = (0, 1), (2, 3)
    sent.near_count[2], sent.obstacle_count[2] = 2, 1
    sent.near[2, :2] = [(4, 1, 2, 3, 4), (9, -1, -2, -3, -4)]
    sent.obstacles[2, 0] = (3, 4, 1.5)
    heard.near[0], heard.near_count[0] = (7, 7, 7, 7, 7), 9  # what an earlier tick left
    SensedReader(heard).read(b"".join(SensedPacker(sent).pack(2)), 0, 2, 1)
    assert (heard.position[0].tolist(), heard.velocity[0].tolist()) == ([0, 1], [2, 3])
    assert heard.near[0, : heard.near_count[0]].tolist() == sent.near[2, :2].tolist()
    assert heard.obstacles[0, : heard.obstacle_count[0]].tolist() == [(3.0, 4.0, 1.5)]


def test_a_tick_is_read_in_its_parts() -> None:
    tick = messages.unpack_from_world(
        messages.pack(make_tick(3, 9, -1, (bytes(32), bytes(80), bytes(24)), [4, 2], [b"one", b"other"]))
    )
    assert isinstance(tick, messages.Tick)
    assert (tick.tick, tick.proof, tick.followed, tick.near, tick.obstacles) == (3, 9, -1, 2, 1)
    assert tick.frames() == [(4, b"one"), (2, b"other")]


@pytest.mark.parametrize(
    "sensed",
    [(bytes(32), bytes(40 * (MAX_NEAR + 1)), b""), (bytes(32), b"", bytes(24 * (MAX_OBSTACLES + 1)))],
)
def test_more_than_a_drone_senses_is_no_tick(sensed: tuple[bytes, bytes, bytes]) -> None:
    with pytest.raises(MessageError):
        messages.unpack_from_world(make_tick(3, 9, 2, sensed).data)


@pytest.mark.parametrize("size", range(len(make_tick(3, 9, 2, (bytes(32), bytes(40), bytes(24))).data)))
def test_a_tick_that_is_cut_off_is_refused(size: int) -> None:
    whole = make_tick(3, 9, 2, (bytes(32), bytes(40), bytes(24))).data
    with pytest.raises(MessageError):
        messages.unpack_from_world(whole[:size])


def as_sent(status: AgentStatus) -> Any:
    return msgpack.unpackb(msgpack.packb(status))


def test_a_status_is_read_as_it_was_written() -> None:
    assert parse_status(as_sent(STATUS), 6) == STATUS


@pytest.mark.parametrize(
    "wrong",
    [
        STATUS._replace(slot=-1),
        STATUS._replace(slot=6),
        STATUS._replace(slot=2**63),  # no number that the world's arrays could hold
        STATUS._replace(slot=1.5),
        STATUS._replace(heard=True),
        STATUS._replace(rejected=(0,) * 6),
        STATUS._replace(rejected=5),
        STATUS._replace(swaps=(0,)),
        STATUS._replace(swaps=(-1,) * len(SWAP_COUNTS)),
        STATUS._replace(digest="x"),
        STATUS._replace(view=bytes(5)),
        STATUS._replace(view="abcdef"),
    ],
)
def test_a_status_that_cannot_be_is_refused(wrong: Any) -> None:
    with pytest.raises((ValueError, TypeError)):
        parse_status(as_sent(wrong), 6)


@given(
    fields=st.recursive(
        st.integers() | st.none() | st.binary(max_size=8), lambda inner: st.lists(inner, max_size=7)
    )
)
def test_no_status_of_any_shape_brings_another_error(fields: Any) -> None:
    with pytest.raises((ValueError, TypeError)):
        parse_status(fields, 6)
