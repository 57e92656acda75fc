"""Whatever can be said is read as it was written, in every format of the wire. (Of frames: test_frames; of notes
and certificates: tests/fuzz.)"""

from typing import Any

import msgpack
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from protocols.dynamics import ABSURD_MPS2
from protocols.wire import messages, pieces
from protocols.wire.frames import MAX_FRAME_BYTES, REASONS
from protocols.wire.login import Login
from protocols.wire.messages import Farewell, FromDrone, Hello, Ready, Reply, Tick, make_tick
from protocols.wire.planned import PLAN_BYTES
from protocols.wire.sensed import (
    DISC,
    MAX_NEAR,
    MAX_OBSTACLES,
    NEIGHBOUR,
    SensedPacker,
    SensedReader,
    empty_sensed,
)
from protocols.wire.status import SWAP_COUNTS, AgentStatus, parse_status

AGENTS = 6
SLOT = st.integers(0, AGENTS - 1)
COUNT, PROCESS, DIGEST = (
    st.integers(0, 10**6),
    st.integers(0, messages.MAX_PROCESS),
    st.integers(0, 2**64 - 1),
)

STATUS = st.builds(
    AgentStatus,
    SLOT,
    st.integers(0, AGENTS - 1),
    st.tuples(*[COUNT] * len(REASONS)),
    st.tuples(*[COUNT] * len(SWAP_COUNTS)),
    DIGEST,
    st.permutations(range(AGENTS)).map(bytes),
)
PUSH = st.floats(-ABSURD_MPS2, ABSURD_MPS2)
FRAME = st.binary(max_size=MAX_FRAME_BYTES)
SENT = st.binary(min_size=1, max_size=MAX_FRAME_BYTES)
TICK = st.integers(0, messages.MAX_TICK)


def made(kind: Any, **fields: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """Messages of this kind; other fields are numbers."""
    return st.builds(kind, **{name: fields.get(name, PROCESS) for name in kind._fields})


SAID = st.one_of(
    made(Hello),
    made(Ready),
    made(Farewell, status=STATUS),
    made(
        Reply,
        tick=TICK,
        ax=PUSH,
        ay=PUSH,
        slot=SLOT,
        frame=st.none() | SENT,
        status=st.none() | STATUS,
        plan=st.just(b"") | st.binary(min_size=PLAN_BYTES, max_size=PLAN_BYTES),
    ),
)


def again(value: object) -> Any:
    """As it comes out of the msgpack around it."""
    return msgpack.unpackb(msgpack.packb(value))


@given(STATUS)
def test_a_drones_account(status: AgentStatus) -> None:
    assert parse_status(again(status), AGENTS) == status


@given(SAID)
def test_what_a_drone_says(said: FromDrone) -> None:
    assert messages.unpack_from_drone(messages.pack(said), AGENTS) == said


HEARD = st.lists(st.tuples(st.integers(0, 2**16 - 1), FRAME), max_size=5)


@given(tick=TICK, followed=st.integers(-1, messages.MAX_TICK), proof=PROCESS, heard=HEARD)
def test_a_tick(tick: int, followed: int, proof: int, heard: list[tuple[int, bytes]]) -> None:
    sources, frames = [source for source, _ in heard], [frame for _, frame in heard]
    said = make_tick(tick, proof, followed, (bytes(32), bytes(80), bytes(24)), sources, frames)
    read = messages.unpack_from_world(messages.pack(said))
    assert read == said
    assert isinstance(read, Tick)
    assert read.frames() == heard


@given(near=st.integers(0, MAX_NEAR), obstacles=st.integers(0, MAX_OBSTACLES), seed=st.integers(0, 2**32 - 1))
def test_what_is_sensed(near: int, obstacles: int, seed: int) -> None:
    sent, heard, draw = empty_sensed(2), empty_sensed(1), np.random.default_rng(seed)
    sent.position[1], sent.velocity[1] = draw.normal(size=2), draw.normal(size=2)
    sent.near_count[1], sent.obstacle_count[1] = near, obstacles
    sent.near[1, :near] = np.frombuffer(draw.bytes(near * NEIGHBOUR.itemsize), NEIGHBOUR)
    sent.obstacles[1, :obstacles] = np.frombuffer(draw.bytes(obstacles * DISC.itemsize), DISC)
    packed = SensedPacker(sent).pack(1)
    SensedReader(heard).read(b"before" + b"".join(packed), 6, near, obstacles)
    assert SensedPacker(heard).pack(0) == packed


@given(
    st.lists(
        st.tuples(st.sampled_from([b"\0", b"\1", b"\x95"]), st.integers(0, 3 * pieces.LONGEST)), max_size=4
    )
)
def test_messages_of_any_length_in_pieces(said: list[tuple[bytes, int]]) -> None:
    joiner, whole = pieces.Joiner(), [(begin * length)[:length] for begin, length in said]
    cut = [piece for number, message in enumerate(whole) for piece in pieces.cut(message, number)]
    assert [message for piece in cut if (message := joiner.join(piece)) is not None] == whole


def test_pieces_without_an_end_are_not_kept() -> None:
    joiner = pieces.Joiner(longest=100)
    for number in range(1000):
        assert joiner.join(next(pieces.cut(bytes(1000), number, 60))) is None
        assert joiner._bytes <= 100
    assert joiner.join(b"\x95") == b"\x95"


@given(
    swarm=st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_-]{0,20}", fullmatch=True),
    agent=st.integers(0, 249),
    password=st.from_regex(r"[A-Za-z0-9_-]{1,40}", fullmatch=True),
)
def test_a_login(swarm: str, agent: int, password: str) -> None:
    login = Login(swarm, agent, password)
    assert Login.from_json(login.to_json()) == login
