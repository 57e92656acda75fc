"""Messages between the world and a drone: read as written, or refused."""

from typing import Any

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols.wire import messages
from protocols.wire.messages import MessageError
from protocols.wire.sensed import MAX_NEAR, SensedPacker, SensedReader, empty_sensed
from protocols.wire.status import SWAP_COUNTS, AgentStatus, parse_status

STATUS = AgentStatus(3, 4, (0,) * 7, (0,) * len(SWAP_COUNTS), 99, bytes(range(6)))


def test_a_message_is_read_as_it_was_written() -> None:
    kind, fields = messages.unpack(messages.pack(messages.REPLY, 7, 0.5, -0.5, 3, b"frame", None))
    assert (kind, list(fields)) == (messages.REPLY, [7, 0.5, -0.5, 3, b"frame", None])
    assert messages.unpack(messages.pack(messages.BYE)) == (messages.BYE, [])


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xc1",
        b"\x93\x01",
        msgpack.packb(5),
        msgpack.packb([]),
        msgpack.packb([99]),
        msgpack.packb(["hi"]),
    ],
)
def test_what_is_no_message_is_refused(data: bytes) -> None:
    with pytest.raises(MessageError):
        messages.unpack(data)


@given(data=st.binary(max_size=200))
def test_random_bytes_are_a_message_or_refused(data: bytes) -> None:
    try:
        kind, _ = messages.unpack(data)
    except MessageError:
        return
    assert messages.HELLO <= kind <= messages.BYE


def test_a_world_tells_its_drones_that_it_lives_before_they_give_up() -> None:
    assert messages.WAIT_EVERY_S * 3 < messages.SILENCE_LIMIT_S


def test_what_is_sensed_survives_the_wire() -> None:
    sent, heard = empty_sensed(3), empty_sensed(1)
    sent.motion[2] = range(4)
    sent.near_count[2], sent.obstacle_count[2] = 2, 1
    sent.near[2, :2] = [[4, 1, 2, 3, 4], [9, -1, -2, -3, -4]]
    sent.obstacles[2, 0] = [3, 4, 1.5]
    heard.near[0], heard.near_count[0] = 7.0, 9  # what an earlier tick left
    SensedReader(heard).read(SensedPacker(sent).pack(2))
    assert heard.motion[0].tolist() == sent.motion[2].tolist()
    assert heard.near[0, : heard.near_count[0]].tolist() == sent.near[2, :2].tolist()
    assert heard.obstacles[0, : heard.obstacle_count[0]].tolist() == [[3.0, 4.0, 1.5]]


def test_more_neighbours_than_a_drone_senses_are_refused() -> None:
    crowd = bytes(8 * 5 * (MAX_NEAR + 1))
    with pytest.raises(ValueError, match="not what a drone senses"):
        SensedReader(empty_sensed(1)).read((bytes(32), crowd, b""))


def as_sent(status: AgentStatus) -> Any:
    return msgpack.unpackb(msgpack.packb(status))


def test_a_status_is_read_as_it_was_written() -> None:
    assert parse_status(as_sent(STATUS), 6) == STATUS


@pytest.mark.parametrize(
    "wrong",
    [
        STATUS._replace(slot=-1),
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
