"""What a drone's process and the radio host of its vehicle say to each other, and on which keys; the mode of a vehicle.

    order    drone to host, at 50 Hz: what the vehicle is to do. An order that is said again keeps its number; setpoints count on.
    account  host to drone, at 100 Hz: what the vehicle does, and which order it follows.
    fix      to the host, from whatever measures places in the room: where the vehicle is.

All in the frame of the room: metres, x east, y north, z up; yaw and tilt in radians. Little endian, fixed in size; what is not
finite or absurdly far is refused. Drone ``i`` of swarm ``s`` speaks on ``s/body/i/NAME/setpoint`` and hears on
``s/body/i/NAME/state``, with the name of its vehicle (`name_of`): whoever finds the host of another fleet leads nobody there.
"""

import math
import re
import struct
import zlib
from enum import IntFlag, StrEnum
from typing import NamedTuple

from protocols.wire.endpoints import is_port
from protocols.wire.keys import checked_agent, checked_swarm

Vector = tuple[float, float, float]

VERSION = 1
_FIRST_PORT = 7470
FARTHEST = 1000.0  #: metres, m/s or m/s²: no number is larger
_URI = re.compile(
    r"radio://(?P<dongle>\d{1,2})/(?P<channel>\d{1,3})/(250K|1M|2M)(/[0-9A-Fa-f]{10})?|udp://[^/:\s]+:(?P<port>\d{1,5})|usb://\d",
    re.ASCII,
)
_LAST_CHANNEL = 125
_ORDER, _ACCOUNT, _FIX = struct.Struct("<BBI10f"), struct.Struct("<BBIBH10f"), struct.Struct("<B3f")


class VehicleMessageError(ValueError):
    """Bytes that are no such message. One line."""


class Mode(StrEnum):
    """What a vehicle does."""

    GROUND = "ground"  # stands, motors off or idling
    CLIMB = "climb"
    HOLD = "hold"
    FOLLOW = "follow"  # setpoints
    LAND = "land"
    DEAD = "dead"  # motors cut in flight: it falls, or has fallen


class Kind(StrEnum):
    """What a vehicle is to do; NOTHING is said until there is something else to say."""

    NOTHING = "nothing"
    ARM = "arm"
    TAKE_OFF = "take-off"  # to the height p[2]
    FLY = "fly"
    HOLD = "hold"
    LAND = "land"
    KILL = "kill"


class Ill(IntFlag):
    """What is wrong with a vehicle; in words: `WORDS`."""

    NO_LINK = 1
    NO_POSITION = 2
    LOCKED = 4
    TURNED_OVER = 8
    REFUSES = 16


WORDS = {
    Ill.NO_LINK: "nothing comes from the vehicle",
    Ill.NO_POSITION: "it is not sure of its position",
    Ill.LOCKED: "locked after a failsafe or a crash: switch it off and on",
    Ill.TURNED_OVER: "it lies on its side",
    Ill.REFUSES: "it cannot be armed: its console in cfclient says why",
}


class Order(NamedTuple):
    """``number`` tells one order from the next; p, v, a and yaw are a setpoint's."""

    kind: Kind
    number: int
    p: Vector = (0.0, 0.0, 0.0)
    v: Vector = (0.0, 0.0, 0.0)
    a: Vector = (0.0, 0.0, 0.0)
    yaw: float = 0.0


class Account(NamedTuple):
    """``followed``: number of the order that is obeyed. age_s: since p was measured. battery: 0 to 1."""

    mode: Mode
    followed: int
    armed: bool
    ill: Ill
    p: Vector
    v: Vector
    yaw: float
    tilt: float
    age_s: float
    battery: float


_KINDS, _MODES = tuple(Kind), tuple(Mode)


def host_endpoint(dongle: int) -> str:
    """Where the radio host of a dongle listens, unless somebody says otherwise."""
    return f"tcp/127.0.0.1:{_FIRST_PORT + dongle}"


def dongle_of(uri: str) -> int:
    """The dongle that the address of a Crazyflie names; 0 where it names none.

    Raises:
        ValueError: it is no such address. One line.
    """
    match = _URI.fullmatch(uri)
    if not match or int(match["channel"] or 0) > _LAST_CHANNEL or not is_port(int(match["port"] or 1)):
        raise ValueError(
            f"{uri!r} is no address of a Crazyflie: one reads radio://0/80/2M/E7E7E7E701 (dongle, channel to {_LAST_CHANNEL}, "
            "rate, address of ten digits), or udp://127.0.0.1:19850"
        )
    return int(match["dongle"] or 0)


def name_of(uri: str) -> str:
    """A vehicle's address as a part of a key."""
    return f"{zlib.crc32(uri.encode()):08x}"


def order_key(swarm: str, drone: int, uri: str) -> str:
    """Where the orders to the vehicle of ``drone`` at ``uri`` are said."""
    return _key(swarm, drone, f"{name_of(uri)}/setpoint")


def account_key(swarm: str, drone: int, uri: str) -> str:
    """Where the vehicle of ``drone`` at ``uri`` gives account."""
    return _key(swarm, drone, f"{name_of(uri)}/state")


def fix_key(swarm: str, drone: int) -> str:
    """Where the vehicle of ``drone`` is told where it is."""
    return _key(swarm, drone, "position")


def pack_order(order: Order) -> bytes:
    return _ORDER.pack(
        VERSION, _KINDS.index(order.kind), order.number, *order.p, *order.v, *order.a, order.yaw
    )


def unpack_order(data: bytes) -> Order:
    """Raises VehicleMessageError."""
    kind, number, *numbers = _unpack(_ORDER, data, "order")
    if kind >= len(_KINDS):
        raise VehicleMessageError(f"{kind} is no kind of order: there are {len(_KINDS)}")
    x = _checked(numbers, "order")
    return Order(_KINDS[kind], number, (x[0], x[1], x[2]), (x[3], x[4], x[5]), (x[6], x[7], x[8]), x[9])


def pack_account(account: Account) -> bytes:
    """An infinite age is said as one of `FARTHEST` seconds."""
    return _ACCOUNT.pack(
        VERSION,
        _MODES.index(account.mode),
        account.followed,
        account.armed,
        account.ill,
        *account.p,
        *account.v,
        account.yaw,
        account.tilt,
        min(account.age_s, FARTHEST),
        account.battery,
    )


def unpack_account(data: bytes) -> Account:
    """Raises VehicleMessageError."""
    mode, followed, armed, ill, *numbers = _unpack(_ACCOUNT, data, "account")
    if mode >= len(_MODES) or armed > 1 or ill >= 2 * max(Ill):
        raise VehicleMessageError("an account of a vehicle with a mode, arming or health that does not exist")
    x = _checked(numbers, "account")
    if x[8] < 0.0 or not 0.0 <= x[9] <= 1.0:
        raise VehicleMessageError(
            "an account of a vehicle with an age below 0 or a battery outside of 0 to 1"
        )
    age_s = math.inf if x[8] >= FARTHEST else x[8]
    p, v = (x[0], x[1], x[2]), (x[3], x[4], x[5])
    return Account(_MODES[mode], followed, bool(armed), Ill(ill), p, v, x[6], x[7], age_s, x[9])


def pack_fix(p: Vector) -> bytes:
    return _FIX.pack(VERSION, *p)


def unpack_fix(data: bytes) -> Vector:
    """Raises VehicleMessageError."""
    x = _checked(_unpack(_FIX, data, "position"), "position")
    return x[0], x[1], x[2]


def _key(swarm: str, drone: int, what: str) -> str:
    return f"{checked_swarm(swarm)}/body/{checked_agent(drone)}/{what}"


def _unpack(form: struct.Struct, data: bytes, what: str) -> tuple[int, ...]:
    if len(data) != form.size:
        raise VehicleMessageError(f"{len(data)} bytes are no {what} of a vehicle: one has {form.size}")
    version, *rest = form.unpack(data)
    if version != VERSION:
        raise VehicleMessageError(
            f"a vehicle's {what} of version {version}: this one reads {VERSION}; use one version"
        )
    return tuple(rest)


def _checked(numbers: "list[int] | tuple[int, ...]", what: str) -> tuple[float, ...]:
    for number in numbers:
        if not abs(number) <= FARTHEST:  # not a number is refused too
            raise VehicleMessageError(f"{number:g} in a vehicle's {what}: none is beyond {FARTHEST:g}")
    return tuple(float(number) for number in numbers)
