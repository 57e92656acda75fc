"""A vehicle behind MAVLink and its fake, through the real pymavlink, in a time that passes when it is told to."""

import math
from collections import deque
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.air.mavlink import MavlinkVehicle
from agent.air.vehicle import Mode, Rig, Setpoint, State
from tests.fakes.autopilot import FakeAutopilot

HEIGHT = 2.0
START = (3.0, -1.0, 0.0)
WHERE = "udpin:127.0.0.1:14550"


class Wire:
    """A connection of pymavlink, to a fake."""

    def __init__(self, fake: FakeAutopilot) -> None:
        self._fake, self._heard = fake, deque[Any]()
        self.mav = mavlink.MAVLink(self, srcSystem=255, srcComponent=191)
        self._reader = mavlink.MAVLink(None)
        self._reader.robust_parsing = True

    def write(self, data: bytes) -> None:
        self.hear(self._fake.take(bytes(data)))

    def hear(self, datagrams: list[bytes]) -> None:
        for datagram in datagrams:
            self._heard.extend(self._reader.parse_buffer(datagram) or [])

    def recv_msg(self) -> Any:
        return self._heard.popleft() if self._heard else None

    def close(self) -> None:
        pass


class Flight:
    """A vehicle and its fake, and a time that passes when it is told to."""

    def __init__(self, fake: FakeAutopilot, where: str = WHERE, **options: str) -> None:
        self.fake, self.now = fake, 50.0
        self.wire = Wire(fake)
        rig = Rig(0, START, 2.0, 3.0, options=options)
        self.vehicle = MavlinkVehicle(where, rig, lambda _: self.wire, lambda: self.now, self.pass_by)

    def pass_by(self, seconds: float) -> None:
        self.now += seconds
        self.wire.hear(self.fake.advance(seconds))

    def wait(self, seconds: float) -> State:
        """Look at it 100 times a second."""
        for _ in range(round(100 * seconds)):
            self.pass_by(0.01)
            state = self.vehicle.state()
        return state

    def until(self, so: Callable[[State], bool], longest_s: float = 20.0) -> State:
        for _ in range(round(100 * longest_s)):
            if so(state := self.wait(0.01)):
                return state
        raise AssertionError(state)

    def arm(self) -> None:
        self.vehicle.open(3.0)
        assert self.wait(1.0).health == ()
        self.vehicle.arm()
        self.until(lambda state: state.armed)

    def climb(self) -> None:
        self.arm()
        self.vehicle.take_off(HEIGHT)
        self.until(lambda state: state.mode is Mode.HOLD)

    def go(self, way: tuple[float, float], seconds: float) -> float:
        """Along a straight line; how far off it was at worst."""
        (x, y, _), worst, steps = self.fake.motion.p, 0.0, round(100 * seconds)
        for step in range(steps):
            p = x + way[0] * step / steps, y + way[1] * step / steps, HEIGHT
            v = way[0] / seconds, way[1] / seconds, 0.0
            self.vehicle.fly(Setpoint(p, v, (0.0, 0.0, 0.0), yaw=0.5))
            self.wait(0.01)
            worst = max(worst, math.dist(p, self.fake.motion.p))
        return worst
