"""What the world and a drone's process say to each other over Zenoh. Tick and Reply, said a hundred times a second and more, have
a fixed layout that begins with their mark; the others are one msgpack array each, kind first, then its fields.

drone -> world   Hello     asks to take part, repeated until welcomed
                 Ready     will answer every tick from now on; also the answer to Wait: I am here
                 Reply     the answer to a Tick
                 Farewell  the answer to Bye
world -> drone   Welcome   the mission
                 Tick      what is sensed and heard now; the same one again where the answer has not come
                 Wait      nothing new, but the world is alive
                 Bye       the flight is over
                 Refused   this process has no place in the flight

Two processes may hold one login: each drawn number ``process`` tells one from the other, and the world flies one of them.
A Reply repeats the number ``proof`` that the world has drawn for its Tick: so the world knows what was read, and does not fill
the pipe to one who answers without reading.
"""

import re
import struct
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import msgpack

from protocols.dynamics import ABSURD_MPS2
from protocols.wire.frames import MAX_FRAME_BYTES
from protocols.wire.heard import pack_heard, unpack_heard
from protocols.wire.planned import PLAN_BYTES
from protocols.wire.sensed import DISC, MAX_NEAR, MAX_OBSTACLES, NEIGHBOUR, OWN_BYTES, Packed
from protocols.wire.status import AgentStatus, parse_status

VERSION = 8
WAIT_EVERY_S = 0.2  # while nothing else is said, the world says Wait this often
# A drone that nobody looks after leaves when the world is silent for this long: longer than a pause.
SILENCE_LIMIT_S = 90.0
MAX_HEARD = 1024  # frames one drone can be handed in one tick: of 249 others, some late and some twice
FLIGHT_BYTES = 8
MAX_PROCESS = MAX_PROOF = 2**32 - 1
MAX_TICK = 2**31 - 1
MAX_FROM_DRONE = 4096  # bytes: the longest frame, the account of one of 250 drones, and some room
# What a drone says holds lists of numbers and byte strings, and nothing else.
_FROM_DRONE = {"max_array_len": 16, "max_map_len": 0, "max_ext_len": 0, "max_str_len": 0}

# No msgpack array begins like these.
TICK_MARK, REPLY_MARK = ord("T"), ord("R")
#: Mark, obstacles sensed, neighbours sensed, tick, proof, followed, frames heard; then what is sensed (protocols.wire.sensed),
#: then the frames (protocols.wire.heard).
TICK_HEAD = struct.Struct("<BBHIIiI")
#: Mark, process, tick, proof, slot, bytes of the frame, of the account, of the plan, ax, ay; then these three.
REPLY_HEAD = struct.Struct("<BxxxIIIHHHHdd")


class TickAt(NamedTuple):
    """Where the numbers of a Tick's head begin, for kernels."""

    mark: int
    obstacles: int
    near: int
    tick: int
    proof: int
    followed: int
    heard: int


class ReplyAt(NamedTuple):
    """The same of a Reply's."""

    mark: int
    process: int
    tick: int
    proof: int
    slot: int
    frame_size: int
    account_size: int
    plan_size: int
    ax: int
    ay: int


def _places(head: struct.Struct) -> Iterator[int]:
    for number in re.finditer("[^<x]", head.format):
        upto, its = head.format[: number.end()], number.group()
        yield struct.calcsize(upto) - struct.calcsize(f"<{its}")


TICK_AT, REPLY_AT = TickAt(*_places(TICK_HEAD)), ReplyAt(*_places(REPLY_HEAD))


class MessageError(ValueError):
    """A message that is not of this protocol."""


class Hello(NamedTuple):
    version: int
    process: int


class Ready(NamedTuple):
    process: int


class Reply(NamedTuple):
    """Acceleration (ax, ay) in m/s^2, the slot it holds, a broadcast frame when one is due, now and then its account; what it has
    planned now, if anything, packed, where somebody looks on (protocols.wire.planned).
    """

    process: int
    tick: int
    proof: int
    ax: float
    ay: float
    slot: int
    frame: bytes | None
    status: AgentStatus | None
    plan: bytes = b""


class Farewell(NamedTuple):
    process: int
    status: AgentStatus


class Welcome(NamedTuple):
    """``briefing``: as Mission.briefing. ``initial_slots``: one byte per agent. ``boot``: how often this drone was restarted.
    ``flight``: drawn for each flight; what a drone seals is good in this one only. ``datagram_key``: with which this process may
    speak in datagrams too (protocols.wire.datagrams); empty: not at all. ``watched``: somebody looks on, and wants to know plans.
    """

    process: int
    briefing: dict[str, Any]
    initial_slots: bytes
    boot: int
    flight: bytes
    datagram_key: bytes
    watched: bool


class Tick(NamedTuple):
    """``followed``: the tick of the Reply by which the drone flies now; -1: none yet. ``near``, ``obstacles``, ``heard``: how
    many neighbours and obstacles it senses and frames it hears, which are in ``data``, the whole message.
    """

    tick: int
    proof: int
    followed: int
    near: int
    obstacles: int
    heard: int
    data: bytes

    @property
    def heard_at(self) -> int:
        """Where in ``data`` the frames begin."""
        return _heard_at(self.near, self.obstacles)

    def frames(self) -> list[tuple[int, bytes]]:
        """What is heard, as far as it is whole: source and frame."""
        return list(unpack_heard(self.data[self.heard_at :], self.heard))


class Wait(NamedTuple):
    pass


class Bye(NamedTuple):
    pass


class Refused(NamedTuple):
    process: int
    why: str


FromDrone = Hello | Ready | Reply | Farewell
FromWorld = Welcome | Tick | Wait | Bye | Refused
_KINDS: tuple[type, ...] = (Hello, Ready, Farewell, Welcome, Wait, Bye, Refused)
_NUMBER = {kind: number for number, kind in enumerate(_KINDS)}


def _heard_at(near: int, obstacles: int) -> int:
    return TICK_HEAD.size + OWN_BYTES + near * NEIGHBOUR.itemsize + obstacles * DISC.itemsize


def make_tick(
    tick: int,
    proof: int,
    followed: int,
    sensed: Packed,
    sources: Sequence[int] = (),
    heard: Sequence[bytes] = (),
) -> Tick:
    """A Tick of these parts: ``sources[i]`` sent ``heard[i]``."""
    near, obstacles = len(sensed[1]) // NEIGHBOUR.itemsize, len(sensed[2]) // DISC.itemsize
    head = TICK_HEAD.pack(TICK_MARK, obstacles, near, tick, proof, followed, len(heard))
    data = head + b"".join(sensed) + pack_heard(zip(sources, heard, strict=True))
    return Tick(tick, proof, followed, near, obstacles, len(heard), data)


def pack(message: FromDrone | FromWorld) -> bytes:
    """One message.

    Raises:
        struct.error: a Reply of numbers that have no room in it.
    """
    if isinstance(message, Reply):
        return _pack_reply(message)
    if isinstance(message, Tick):
        return message.data
    packed: bytes = msgpack.packb((_NUMBER[type(message)], *message))
    return packed


def _pack_reply(reply: Reply) -> bytes:
    process, tick, proof, ax, ay, slot, frame, status, plan = reply
    frame, account = frame or b"", b"" if status is None else msgpack.packb(status)
    sizes = len(frame), len(account), len(plan)
    head = REPLY_HEAD.pack(REPLY_MARK, process, tick, proof, slot, *sizes, ax, ay)
    return head + frame + account + plan


def with_account(reply: bytes, status: AgentStatus) -> bytes:
    """This packed Reply, which holds no account, with one."""
    account: bytes = msgpack.packb(status)
    at = REPLY_AT.account_size
    end = len(reply) - int.from_bytes(reply[REPLY_AT.plan_size : REPLY_AT.plan_size + 2], "little")
    return reply[:at] + len(account).to_bytes(2, "little") + reply[at + 2 : end] + account + reply[end:]


def _unpack_reply(data: bytes, agents: int) -> Reply:
    if len(data) < REPLY_HEAD.size:
        raise MessageError("Reply: too short")
    _, process, tick, proof, slot, frame_size, account_size, plan_size, ax, ay = REPLY_HEAD.unpack_from(data)
    account_at = REPLY_HEAD.size + frame_size
    plan_at = account_at + account_size
    if plan_at + plan_size != len(data) or plan_size not in (0, PLAN_BYTES):
        raise MessageError("Reply: not as long as it says")
    if slot >= agents or tick > MAX_TICK:
        raise MessageError("Reply: no such slot or tick")
    if not (abs(ax) <= ABSURD_MPS2 and abs(ay) <= ABSURD_MPS2):
        raise MessageError("not a command")
    frame = data[REPLY_HEAD.size : account_at] if 0 < frame_size <= MAX_FRAME_BYTES else None
    account = data[account_at:plan_at]
    status = _status(_msgpack(account, **_FROM_DRONE), agents) if account else None
    return Reply(process, tick, proof, ax, ay, slot, frame, status, data[plan_at:])


def _unpack_tick(data: bytes) -> Tick:
    if len(data) < TICK_HEAD.size:
        raise MessageError("Tick: too short")
    _, obstacles, near, tick, proof, followed, heard = TICK_HEAD.unpack_from(data)
    if (
        near > MAX_NEAR
        or obstacles > MAX_OBSTACLES
        or tick > MAX_TICK
        or _heard_at(near, obstacles) > len(data)
    ):
        raise MessageError("not a tick")
    return Tick(tick, proof, followed, near, obstacles, heard, data)


def _msgpack(data: bytes, **limits: int) -> Any:
    try:
        return msgpack.unpackb(data, **limits)
    except Exception as error:  # whatever these bytes do to their reader
        raise MessageError(f"not a message of this protocol ({type(error).__name__})") from error


def _unpack(data: bytes, **limits: int) -> tuple[type, list[Any]]:
    whole = _msgpack(data, **limits)
    if type(whole) is not list or not whole:
        raise MessageError("a message is a list")
    number, *fields = whole
    if type(number) is not int or not 0 <= number < len(_KINDS):
        raise MessageError("unknown kind of message")
    kind = _KINDS[number]
    if len(fields) != len(kind._fields):  # type: ignore[attr-defined]
        raise MessageError(f"{kind.__name__}: {len(fields)} fields")
    return kind, fields


def _whole(value: Any, highest: int, what: str) -> int:
    if type(value) is not int or not 0 <= value <= highest:
        raise MessageError(f"not {what}")
    return value


def _typed(fields: list[Any], *types: type) -> None:
    for field, expected in zip(fields, types, strict=True):
        if type(field) is not expected:
            raise MessageError(f"{type(field).__name__} where {expected.__name__} is due")


def _status(value: Any, agents: int) -> AgentStatus:
    try:
        return parse_status(value, agents)
    except ValueError as error:
        raise MessageError(f"not an account ({error})") from error


def unpack_from_drone(data: bytes, agents: int) -> FromDrone:
    """What a drone of a swarm of ``agents`` says: right in form and range. A frame that is too long goes no further.

    Raises:
        MessageError: it is not what a drone says.
    """
    if len(data) > MAX_FROM_DRONE:
        raise MessageError(f"{len(data)} bytes")
    if data and data[0] == REPLY_MARK:
        return _unpack_reply(data, agents)
    kind, fields = _unpack(data, **_FROM_DRONE)
    if kind is Hello and type(fields[0]) is int:
        return Hello(fields[0], _whole(fields[1], MAX_PROCESS, "a process"))
    if kind not in (Ready, Farewell):
        raise MessageError(f"a drone does not say {kind.__name__}")
    process = _whole(fields[0], MAX_PROCESS, "a process")
    return Ready(process) if kind is Ready else Farewell(process, _status(fields[1], agents))


def unpack_from_world(data: bytes) -> FromWorld:
    """What the world says: right in form.

    Raises:
        MessageError: it is not what the world says.
    """
    if data and data[0] == TICK_MARK:
        return _unpack_tick(data)
    kind, fields = _unpack(data)
    if kind is Welcome:
        _typed(fields, int, dict, bytes, int, bytes, bytes, bool)
        if len(fields[4]) != FLIGHT_BYTES:
            raise MessageError("not a flight's name")
        return Welcome(*fields)
    if kind is Wait:
        return Wait()
    if kind is Bye:
        return Bye()
    if kind is Refused:
        _typed(fields, int, str)
        return Refused(*fields)
    raise MessageError(f"the world does not say {kind.__name__}")
