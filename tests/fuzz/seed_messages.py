"""Valid messages for the targets, made by the code that writes them: they follow when a format changes."""

from collections.abc import Callable, Iterator
from typing import Any

import msgpack
import numpy as np

from protocols.slots.history import Swap
from protocols.slots.notes import Acceptance, Assignment, Proposal, Refusal, SlotNote, encode
from protocols.slots.seals import SEAL_BYTES, Sealed
from protocols.wire import messages
from protocols.wire.account import Account as AirAccount
from protocols.wire.beacon import Beacon, pack_beacon
from protocols.wire.frames import (
    FIXED,
    MAX_KNOWN,
    OBSERVATION_SIZE,
    REASONS,
    RELAYED,
    RELAYING,
    FrameWriter,
    empty_frames,
    swarm_tag,
)
from protocols.wire.heard import pack_heard
from protocols.wire.messages import (
    Bye,
    Farewell,
    Hello,
    Ready,
    Refused,
    Reply,
    Wait,
    Welcome,
    make_tick,
    pack,
)
from protocols.wire.nature import Nature, pack_nature, pack_status
from protocols.wire.operator import Order as OperatorOrder
from protocols.wire.operator import Word, pack_word
from protocols.wire.pieces import cut
from protocols.wire.planned import PLAN_BYTES
from protocols.wire.sensed import SensedPacker, empty_sensed
from protocols.wire.status import SWAP_COUNTS, AgentStatus
from protocols.wire.vehicles import (
    Account,
    Ill,
    Kind,
    Mode,
    Order,
    pack_account,
    pack_fix,
    pack_order,
)

AGENTS = 6
NOW = 1000
TAG = swarm_tag("rsc")

_SWAP = Swap(3, 1, 77, 0, 2, 3)
_TAKEN = _SWAP._replace(counter=4, taken=True)
_SEAL = bytes(range(SEAL_BYTES))
_NOTES = (
    SlotNote(0x1234567890ABCDEF, settled=True),
    SlotNote(1, settled=False),
    SlotNote(
        2, False, True, Proposal(1, 2**40, 0, 3, 8), Acceptance(2, 5, 9, _SEAL), (Refusal(1, 2), Refusal(0, 3)),
        (Sealed(_SWAP, 2 * _SEAL), Sealed(_TAKEN, _SEAL)), 0b101011, Assignment(tuple(range(AGENTS)), 2, 3),
    ),
    SlotNote(3, False, ops=tuple(Sealed(_SWAP._replace(counter=count), 2 * _SEAL) for count in range(1, 17))),
)  # fmt: skip
_STATUS = AgentStatus(3, 4, (0,) * len(REASONS), (1,) * len(SWAP_COUNTS), 2**63, bytes(range(AGENTS)))


def packed(value: Any) -> bytes:
    """As msgpack writes it."""
    written: bytes = msgpack.packb(value)
    return written


def made(kind: Callable[..., Any], **fields: Any) -> bytes:
    """A message of this kind, whatever values it is given; fields that are not given are 0."""
    names = kind._fields  # type: ignore[attr-defined]
    return pack(kind(**{name: fields.get(name, 0) for name in names}))


def notes() -> Iterator[bytes]:
    yield from (packed(encode(note)) for note in _NOTES)


def frames() -> Iterator[bytes]:
    draw, rows = np.random.default_rng(0), empty_frames(1, TAG)
    for count, note in zip((0, 3, 5, MAX_KNOWN), _NOTES, strict=True):
        rows.tick[0] = NOW - 1 - count
        rows.motion[0] = draw.normal(0, 20, 4)
        rows.observation[0] = draw.integers(-32768, 32768, OBSERVATION_SIZE)
        rows.ages[0] = draw.integers(0, 256, 8)
        rows.sender[0], rows.slot[0], rows.age_from[0] = draw.integers(0, AGENTS, 3)
        rows.known_count[0], rows.one_hop[0] = count, count // 2
        rows.known[0, :count] = draw.integers(0, AGENTS, count)
        rows.displacement[0, :count] = draw.normal(0, 6, (count, 2))
        rows.loud[0], rows.digest[0] = not (note.quiet and note.settled), note.digest
        yield FrameWriter(rows).write(0, packed(encode(note)) if rows.loud[0] else b"")
    rows.loud[0], rows.version[0] = 0, RELAYING
    rows.relayed[0] = draw.integers(-32768, 32768, (RELAYED, OBSERVATION_SIZE))
    yield FrameWriter(rows).write(0)


def heard() -> Iterator[bytes]:
    place = FIXED.fields["sender"][1]
    said = [(frame[place], frame) for frame in frames()]
    for count in range(len(said) + 1):
        yield bytes([count]) + pack_heard(said[:count])


def statuses() -> Iterator[bytes]:
    yield packed(_STATUS)


def from_drone() -> Iterator[bytes]:
    yield made(Hello, version=messages.VERSION, process=7)
    yield made(Ready, process=messages.MAX_PROCESS)
    yield pack(Reply(7, 3, 9, 0.5, -0.5, 5, b"frame", None))
    yield pack(Reply(7, 0, 0, 0.0, 0.0, 0, None, _STATUS))
    yield pack(Reply(7, 0, 0, 0.0, 0.0, 0, b"frame", _STATUS, bytes(PLAN_BYTES)))
    yield made(Farewell, process=7, status=_STATUS)


def from_world() -> Iterator[bytes]:
    rows = empty_sensed(1)
    rows.near_count[0], rows.obstacle_count[0] = 2, 1
    yield made(
        Welcome,
        process=7,
        mission={"agents": AGENTS},
        initial_slots=bytes(range(AGENTS)),
        boot=1,
        flight=bytes(8),
        datagram_key=b"",
        watched=True,
    )
    said = list(frames())
    yield pack(make_tick(3, 9, 2, SensedPacker(rows).pack(0), range(len(said)), said))
    yield pack(make_tick(3, 9, -1, SensedPacker(empty_sensed(1)).pack(0)))
    yield made(Wait)
    yield made(Bye)
    yield made(Refused, process=7, why="no")


def vehicle_messages() -> Iterator[bytes]:
    x = (1.0, -2.0, 0.5)
    yield b"o" + pack_order(Order(Kind.FLY, 7, x, x, x, -3.0))
    yield b"a" + pack_account(
        Account(Mode.FOLLOW, 7, True, Ill.NO_LINK | Ill.LOCKED, x, x, 1.0, 0.1, 0.01, 0.9)
    )
    yield b"f" + pack_fix(x)


def hands() -> Iterator[bytes]:
    yield b'{"fault": {"kind": "kill", "agents": [1, 2]}}'
    yield b'{"fault": {"kind": "part", "groups": [[0, 1], [2]]}}'
    yield b'{"fault": {"kind": "loss", "loss": 0.3}}'
    yield b'{"pace": {"speed": 0.5, "paused": false}}'
    yield b'{"pace": {"speed": null, "paused": true}}'


def air_messages() -> Iterator[bytes]:
    x = (1.0, -2.0, 0.5)
    yield b"b" + pack_beacon(Beacon(3, 4, 2, 77, 10**15, x, x, 12, 1, -3, 90, True), b"frame")
    yield b"w" + pack_word(Word(5, OperatorOrder.GO, 10**11, 10**15))
    yield (
        b"a"
        + AirAccount(
            3,
            "fly",
            "follow",
            ("it stands 1 m from its start",),
            ("start",),
            (0, 1),
            -0.5,
            2,
            100,
            1,
            0,
            "f",
            "m",
            "1",
        ).to_json()
    )
    yield b"n" + pack_nature(Nature("f" * 16, "m" * 16, 0.0, [x]))
    yield b"s" + pack_status(_STATUS)


def pieces() -> Iterator[bytes]:
    yield b"|".join((*cut(b"ab" * 50, 1, 60), *cut(b"\x93gh", 2), *cut(b"ij" * 50, 3, 60)))
    yield b"|".join(cut(bytes(130_000), 4))
