"""A Crazyflie, as cflib sees one: CRTP, one packet a datagram (header: port << 4 | channel, then up to 30 bytes).

What it does with setpoints is the firmware's (crazyflie-firmware: commander.c, supervisor.c, planner.c):

- A setpoint from the radio outranks the high-level commander and makes it forget its plan. Only a notify-setpoint-stop gives way
  to it; and one that has no plan then says: motors off.
- In flight, a setpoint older than 0.5 s: it levels. Older than 2 s: motors off, and it is locked until it is started anew.
- A landing that is done leaves the motors off. cflib's close_link sends a setpoint of no thrust: in flight, it falls.
"""

import math
import struct
import zlib
from collections.abc import Callable, Iterator
from enum import Enum, auto

from tests.fakes.commander import Commander, Plan
from tests.fakes.motion import STILL, Goal, Motion, Vector

PROTOCOL_VERSION = 12
LEVEL_AFTER_S, CUT_AFTER_S, LANDED_AFTER_S = 0.5, 2.0, 1.9
_STEP_S = 0.005
_POSITION_LASTS_S = 0.5  # without a measurement the estimate is worth less and less
_DRAIN_PER_S = 1 / 420


class Stage(Enum):
    """What its supervisor thinks."""

    UNARMED = auto()
    READY = auto()
    FLYING = auto()
    LEVELLING = auto()
    LOCKED = auto()


class FakeCrazyflie:
    """As tests.fakes.udp.Fake has it.

    Attributes that a test may set:
        frozen: its position is no longer measured: the estimate stays where it is and its variance grows.
        dead_link: nothing comes through, either way. battery: 0 to 1. needs_position: it knows where it is only from the
        positions that it is sent. lies: it is turned over. faulty: a deck says that it is. crashed: it was turned over in flight.
    Attributes to look at:
        motion, stage, motors_on; controller: the number of its controller (2: Mellinger); setpoints: how many it was sent.
    """

    def __init__(self, start: Vector = STILL, arms_itself: bool = True) -> None:
        self.motion = Motion(start)
        self.stage = Stage.READY if arms_itself else Stage.UNARMED
        self._arms_itself = arms_itself
        self.motors_on = self.frozen = self.dead_link = self.needs_position = self.lies = False
        self.faulty = self.crashed = False
        self.battery, self.setpoints = 1.0, 0
        self._now = self._thrust_at = self._measured_at = 0.0
        self._variance = 1e-5
        self._estimate: tuple[Vector, Vector] = (start, STILL)
        self.commander = Commander()
        self._blocks: dict[int, list[tuple[int, int]]] = {}  # id -> (variable, type it is fetched as)
        self._running: dict[int, list[float]] = {}  # id -> [period, when next]
        self._parameters = dict.fromkeys(PARAMETERS, 0.0)

    @property
    def controller(self) -> int:
        return int(self._parameters["stabilizer.controller"])

    # Time

    def advance(self, dt: float) -> list[bytes]:
        said: list[bytes] = []
        until = self._now + dt
        while self._now < until - 1e-9:
            step = min(_STEP_S, until - self._now)
            self._now += step
            self._step(step)
            said += self._logged()
        return [] if self.dead_link else said

    def _step(self, dt: float) -> None:
        commander = self.commander
        commander.follow_plan(self._now)
        self._supervise()
        goal = commander.goal
        if self.stage is Stage.LEVELLING and goal:  # height is kept
            goal = Goal((None, None, goal.p[2]), yaw=self.motion.yaw)
        self.motors_on = goal is not None and self.stage not in (Stage.UNARMED, Stage.LOCKED)
        if self.motors_on and goal:
            self._thrust_at = self._now
            self.battery = max(0.0, self.battery - _DRAIN_PER_S * dt)
            self.motion.fly(goal, dt)
        else:
            self.motion.drop(dt)
        self._locate()

    def _supervise(self) -> None:
        idle = self._now - self._thrust_at
        age = self._now - self.commander.stamp
        if self.stage is Stage.READY and self.motors_on:
            self.stage = Stage.FLYING
        elif self.stage in (Stage.FLYING, Stage.LEVELLING):
            if age > CUT_AFTER_S or (self.lies and self.motion.p[2] > 0.1):
                self.stage = Stage.LOCKED
            elif age > LEVEL_AFTER_S:
                self.stage = Stage.LEVELLING
            elif idle > LANDED_AFTER_S:
                self.stage = Stage.READY if self._arms_itself else Stage.UNARMED
            else:
                self.stage = Stage.FLYING

    def _locate(self) -> None:
        if not self.needs_position and not self.frozen:
            self._measured_at = self._now
            self._estimate = self.motion.p, self.motion.v
        lost = max(0.0, self._now - self._measured_at - _POSITION_LASTS_S)
        self._variance = min(100.0, 1e-5 + 0.05 * lost)

    # What it is sent

    def take(self, datagram: bytes) -> list[bytes]:
        if self.dead_link or not datagram or datagram == b"\xff":
            return [b"\xff"] if datagram == b"\xff" and not self.dead_link else []
        port, channel, data = datagram[0] >> 4, datagram[0] & 3, datagram[1:]
        answer = self._ports().get((port, channel))
        try:
            replies = list(answer(data)) if answer else []
        except (struct.error, IndexError, KeyError, ValueError):
            return []  # as the real one: what it does not understand it does not answer
        return [bytes([datagram[0]]) + reply for reply in replies]

    def _ports(self) -> dict[tuple[int, int], Callable[[bytes], Iterator[bytes]]]:
        return {
            (2, 0): lambda data: _contents(data, [(t, name) for name, t in PARAMETERS.items()]),
            (2, 1): self._read_parameter,
            (2, 2): self._write_parameter,
            (2, 3): self._write_by_name,
            (3, 0): self._roll_pitch_yaw_thrust,
            (4, 0): lambda data: iter([bytes([data[0], 0])]),  # no memories
            (5, 0): lambda data: _contents(data, [(t, name) for name, t in VARIABLES.items()]),
            (5, 1): self._log_settings,
            (6, 0): self._position,
            (6, 1): self._pose,
            (7, 0): self._setpoint,
            (7, 1): self._meta,
            (8, 0): self._high_level,
            (9, 0): lambda data: iter([bytes([0x80 | data[0]]) + struct.pack("<H", self.bits())]),
            (9, 1): self._supervisor_command,
            (13, 1): _version,
            (15, 0): lambda data: iter([data]),
            (15, 1): lambda data: iter([b"Bitcraze Crazyflie\0"]),
        }

    def _read_parameter(self, data: bytes) -> Iterator[bytes]:
        (index,) = struct.unpack("<H", data[:2])
        name = list(PARAMETERS)[index]
        yield data[:2] + b"\0" + _packed(PARAMETER_TYPES[PARAMETERS[name]], self._parameters[name])

    def _write_parameter(self, data: bytes) -> Iterator[bytes]:
        (index,) = struct.unpack("<H", data[:2])
        name = list(PARAMETERS)[index]
        (self._parameters[name],) = struct.unpack(PARAMETER_TYPES[PARAMETERS[name]], data[2:])
        if name == "stabilizer.stop" and self._parameters[name]:
            self.stage = Stage.LOCKED
        yield data

    def _write_by_name(self, data: bytes) -> Iterator[bytes]:
        if data[0] == 0:
            group, name, value = data[1:].split(b"\0", 2)
            index = list(PARAMETERS).index(f"{group.decode()}.{name.decode()}")
            list(self._write_parameter(struct.pack("<H", index) + value[1:]))
            yield data[:1] + group + b"\0" + name + b"\0\0"

    def _roll_pitch_yaw_thrust(self, data: bytes) -> Iterator[bytes]:
        *_, thrust = struct.unpack("<fffH", data)
        hovering = Goal((None, None, self.motion.p[2])) if thrust else None
        self.commander.set(hovering, Commander.RADIO, self._now)
        return iter(())

    def _setpoint(self, data: bytes) -> Iterator[bytes]:
        kind, body = data[0], data[1:]
        goal: Goal | None = None
        if kind == 6:
            numbers = struct.unpack("<hhhhhhhhhIhhh", body)
            x, y, z, vx, vy, vz, ax, ay, az = (number / 1000 for number in numbers[:9])
            goal = Goal((x, y, z), (vx, vy, vz), (ax, ay, az), _yaw(numbers[9]))
        elif kind == 7:
            x, y, z, yaw = struct.unpack("<ffff", body)
            goal = Goal((x, y, z), yaw=math.radians(yaw))
        elif kind == 10:
            vx, vy, _, z = struct.unpack("<ffff", body)
            c, s = math.cos(self.motion.yaw), math.sin(self.motion.yaw)
            goal = Goal((None, None, z), (c * vx - s * vy, s * vx + c * vy, 0.0), yaw=self.motion.yaw)
        elif kind != 0:
            return iter(())
        self.setpoints += 1
        self.commander.set(goal, Commander.RADIO, self._now)
        return iter(())

    def _meta(self, data: bytes) -> Iterator[bytes]:
        if data[0] == 0:
            self.commander.relax()
        return iter(())

    def _high_level(self, data: bytes) -> Iterator[bytes]:
        kind, commander, here = data[0], self.commander, self._estimate[0]
        if kind == 3:
            commander.plan = None
        elif kind in (7, 8):
            _, _, height, yaw, keep_yaw, duration = struct.unpack("<BBff?f", data)
            landing = kind == 8
            busy = commander.plan is not None and (not landing or commander.plan.is_landing)
            if not busy:
                yaw = self.motion.yaw if keep_yaw else yaw
                commander.plan = Plan(here, (here[0], here[1], height), yaw, self._now, duration, landing)
        elif kind == 12:
            _, _, relative, _, x, y, z, yaw, duration = struct.unpack("<BBBBfffff", data)
            if relative:
                x, y, z = x + here[0], y + here[1], z + here[2]
            commander.plan = Plan(here, (x, y, z), yaw, self._now, duration, False)
        else:
            return iter(())
        yield data[:3] + b"\0"

    def _position(self, data: bytes) -> Iterator[bytes]:
        x, y, z = struct.unpack("<fff", data)
        if self.needs_position and not self.frozen:
            self._estimate, self._measured_at = ((x, y, z), self.motion.v), self._now
        return iter(())

    def _pose(self, data: bytes) -> Iterator[bytes]:
        if data[0] == 8:
            yield from self._position(data[1:13])
        elif data[0] == 3:
            self.stage = Stage.LOCKED

    def _supervisor_command(self, data: bytes) -> Iterator[bytes]:
        if data[0] == 1:
            may = self.stage is not Stage.LOCKED and not (self.lies or self.faulty or self.crashed)
            if data[1] and may and self.stage is Stage.UNARMED:
                self.stage = Stage.READY
            elif not data[1] and self.stage is not Stage.LOCKED:
                self.stage = Stage.UNARMED
            yield bytes([0x81, may, self.stage is not Stage.UNARMED])
        elif data[0] == 3:
            self.stage = Stage.LOCKED

    # What it says of itself

    def bits(self) -> int:
        """supervisor.info."""
        armed = self.stage in (Stage.READY, Stage.FLYING, Stage.LEVELLING)
        flying = self.stage in (Stage.FLYING, Stage.LEVELLING)
        told = [
            self.stage is Stage.UNARMED and not (self.lies or self.faulty),
            armed,
            self._arms_itself,
            armed,
            flying,
            self.lies,
        ]
        told += [self.stage is Stage.LOCKED, self.crashed, self.commander.plan is not None]
        return sum(bit << place for place, bit in enumerate(told))

    def _log_settings(self, data: bytes) -> Iterator[bytes]:
        command, block = data[0], data[1] if len(data) > 1 else 0
        if command == 5:
            self._blocks.clear()
            self._running.clear()
        elif command in (6, 7):
            variables = self._blocks.setdefault(block, [])
            for place in range(2, 2 + (len(data) - 2) // 3 * 3, 3):
                fetched, number = struct.unpack("<BH", data[place : place + 3])
                variables.append((number, fetched & 0x0F))
        elif command == 3 and block in self._blocks:
            self._running[block] = [data[2] / 100, self._now]
        elif command == 4:
            self._running.pop(block, None)
        yield bytes([command, block, 0])

    def _logged(self) -> Iterator[bytes]:
        for block, timer in self._running.items():
            if self._now >= timer[1]:
                timer[1] = max(timer[1] + timer[0], self._now - timer[0])
                values, names = self._values(), list(VARIABLES)
                stamp = struct.pack("<I", round(1000 * self._now))[:3]
                body = b"".join(_packed(LOG_TYPES[t], values[names[n]]) for n, t in self._blocks[block])
                yield bytes([5 << 4 | 2, block]) + stamp + body

    def _values(self) -> dict[str, float]:
        p, v = self._estimate
        roll, pitch, yaw = (math.degrees(angle) for angle in self.motion.tilt)
        told = dict(zip(VARIABLES, (*p, *v, 180.0 if self.lies else roll, -pitch, yaw), strict=False))
        told |= {f"stateEstimateZ.{axis}": 1000 * at for axis, at in zip("xyz", p, strict=True)}
        told |= {f"stateEstimateZ.v{axis}": 1000 * speed for axis, speed in zip("xyz", v, strict=True)}
        told |= {f"kalman.varP{axis}": self._variance for axis in "XYZ"}
        # Motors pull it down, by what Bitcraze measured at the thrust of hovering (4.01 to 3.69 V).
        at_rest = min(3.7 + 0.4 * self.battery, 3.2 + 5.0 * self.battery)
        volts = at_rest - (0.32 if self.motors_on else 0.0)
        return told | {"pm.vbat": volts, "supervisor.info": self.bits()}


LOG_TYPES = {1: "<B", 2: "<H", 3: "<L", 4: "<b", 5: "<h", 6: "<i", 7: "<f", 8: "<e"}
PARAMETER_TYPES = {8: "<B", 6: "<f"}
VARIABLES = (
    {f"stateEstimate.{axis}": 7 for axis in ("x", "y", "z", "vx", "vy", "vz", "roll", "pitch", "yaw")}
    | {f"stateEstimateZ.{axis}": 5 for axis in ("x", "y", "z", "vx", "vy", "vz")}
    | {f"kalman.varP{axis}": 7 for axis in "XYZ"}
    | {"pm.vbat": 7, "supervisor.info": 2}
)
PARAMETERS = {
    "stabilizer.controller": 8,
    "stabilizer.estimator": 8,
    "stabilizer.stop": 8,
    "kalman.resetEstimation": 8,
    "locSrv.extPosStdDev": 6,
}


def _packed(how: str, value: float) -> bytes:
    return struct.pack(how, value if how[1] in "fe" else round(value))


def _contents(data: bytes, entries: list[tuple[int, str]]) -> Iterator[bytes]:
    """A table of contents."""
    if data[0] == 3:
        yield struct.pack("<BHI", 3, len(entries), zlib.crc32(repr(entries).encode()))
    elif data[0] == 2:
        (index,) = struct.unpack("<H", data[1:3])
        kind, name = entries[index]
        yield data[:3] + bytes([kind]) + name.replace(".", "\0").encode() + b"\0"


def _version(data: bytes) -> Iterator[bytes]:
    if data[0] == 0:
        yield struct.pack("<BI", 0, PROTOCOL_VERSION)
    else:
        yield data[:1] + {1: b"fake", 2: b"CF21"}.get(data[0], b"")


def _yaw(compressed: int) -> float:
    """Of a quaternion in 32 bits: which part is largest, and the three others with sign and 9 bits each."""
    largest, parts = compressed >> 30, [0.0] * 4
    for place in (3, 2, 1, 0):
        if place != largest:
            size = (compressed & 511) / 511 / math.sqrt(2)
            parts[place] = -size if compressed >> 9 & 1 else size
            compressed >>= 10
    parts[largest] = math.sqrt(max(0.0, 1 - sum(part * part for part in parts)))
    x, y, z, w = parts
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
