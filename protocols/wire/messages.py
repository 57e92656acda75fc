"""What the world and a drone's process say to each other over Zenoh: one msgpack array each, kind first, then its fields.

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

from typing import Any, NamedTuple

import msgpack

from protocols.dynamics import ABSURD_MPS2
from protocols.wire.frames import MAX_FRAME_BYTES
from protocols.wire.sensed import Packed
from protocols.wire.status import AgentStatus, parse_status

VERSION = 6
WAIT_EVERY_S = 0.2  # while nothing else is said, the world says Wait this often
SILENCE_LIMIT_S = (
    90.0  # a drone that nobody looks after leaves when the world is silent for this long: longer than a pause
)
MAX_HEARD = 1024  # frames one drone can be handed in one tick: of 249 others, some late and some twice
FLIGHT_BYTES = 8
MAX_PROCESS = MAX_PROOF = 2**32 - 1
MAX_FROM_DRONE = 4096  # bytes: the longest frame, the account of one of 250 drones, and some room
# What a drone says holds lists of numbers and byte strings, and nothing else.
_FROM_DRONE = {"max_array_len": 16, "max_map_len": 0, "max_ext_len": 0, "max_str_len": 0}


class MessageError(ValueError):
    """A message that is not of this protocol."""


class Hello(NamedTuple):
    version: int
    process: int


class Ready(NamedTuple):
    process: int


class Reply(NamedTuple):
    """Acceleration (ax, ay) in m/s^2, the slot it holds, a broadcast frame when one is due, now and then its account."""

    process: int
    tick: int
    proof: int
    ax: float
    ay: float
    slot: int
    frame: bytes | None
    status: AgentStatus | None


class Farewell(NamedTuple):
    process: int
    status: AgentStatus


class Welcome(NamedTuple):
    """``briefing``: as Mission.briefing. ``initial_slots``: one byte per agent. ``boot``: how often this drone was restarted.
    ``flight``: drawn for each flight; what a drone seals is good in this one only. ``datagram_key``: with which this process may
    speak in datagrams too (protocols.wire.datagrams); empty: not at all.
    """

    process: int
    briefing: dict[str, Any]
    initial_slots: bytes
    boot: int
    flight: bytes
    datagram_key: bytes


class Tick(NamedTuple):
    """``sources[i]`` sent ``heard[i]``. ``followed``: the tick of the Reply by which the drone flies now; -1: none yet."""

    tick: int
    proof: int
    followed: int
    sensed: Packed
    sources: bytes
    heard: list[bytes]


class Wait(NamedTuple):
    pass


class Bye(NamedTuple):
    pass


class Refused(NamedTuple):
    process: int
    why: str


FromDrone = Hello | Ready | Reply | Farewell
FromWorld = Welcome | Tick | Wait | Bye | Refused
_KINDS: tuple[type, ...] = (Hello, Ready, Reply, Farewell, Welcome, Tick, Wait, Bye, Refused)
_NUMBER = {kind: number for number, kind in enumerate(_KINDS)}


def pack(message: FromDrone | FromWorld) -> bytes:
    """One message."""
    packed: bytes = msgpack.packb((_NUMBER[type(message)], *message))
    return packed


def _unpack(data: bytes, **limits: int) -> tuple[type, list[Any]]:
    try:
        number, *fields = msgpack.unpackb(data, **limits)
    except Exception as error:  # whatever these bytes do to their reader
        raise MessageError(f"not a message of this protocol ({type(error).__name__})") from error
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
    kind, fields = _unpack(data, **_FROM_DRONE)
    if kind is Hello and type(fields[0]) is int:
        return Hello(fields[0], _whole(fields[1], MAX_PROCESS, "a process"))
    if kind not in (Ready, Reply, Farewell):
        raise MessageError(f"a drone does not say {kind.__name__}")
    process = _whole(fields[0], MAX_PROCESS, "a process")
    if kind is Ready:
        return Ready(process)
    if kind is Farewell:
        return Farewell(process, _status(fields[1], agents))
    _, tick, proof, ax, ay, slot, frame, status = fields
    if (
        type(ax) is not float
        or type(ay) is not float
        or not (abs(ax) <= ABSURD_MPS2 and abs(ay) <= ABSURD_MPS2)
    ):
        raise MessageError("not a command")
    if frame is not None:
        if type(frame) is not bytes:
            raise MessageError("a frame is bytes")
        if len(frame) > MAX_FRAME_BYTES:
            frame = None
    return Reply(
        process,
        _whole(tick, 2**63, "a tick"),
        _whole(proof, MAX_PROOF, "a proof"),
        ax,
        ay,
        _whole(slot, agents - 1, "a slot"),
        frame,
        None if status is None else _status(status, agents),
    )


def unpack_from_world(data: bytes) -> FromWorld:
    """What the world says: right in form.

    Raises:
        MessageError: it is not what the world says.
    """
    kind, fields = _unpack(data)
    if kind is Tick:  # a hundred times a second: no loop over types
        tick, proof, followed, sensed, sources, heard = fields
        if (
            type(tick) is not int
            or type(proof) is not int
            or type(followed) is not int
            or type(sources) is not bytes
            or type(heard) is not list
        ):
            raise MessageError("not a tick")
        if type(sensed) is not list or len(sensed) != 3:
            raise MessageError("what is sensed comes in three parts")
        own, near, obstacles = sensed
        if type(own) is not bytes or type(near) is not bytes or type(obstacles) is not bytes:
            raise MessageError("what is sensed is bytes")
        return Tick(tick, proof, followed, (own, near, obstacles), sources, heard)
    if kind is Welcome:
        _typed(fields, int, dict, bytes, int, bytes, bytes)
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
