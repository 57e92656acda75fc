"""What a vehicle is to do now: decided from its drone's orders and from what it says of itself, without input or output.

It keeps a vehicle in the air when its drone falls silent, which what flies does not always do by itself: a Crazyflie levels .5 s
after its last setpoint, and 2 s after it cuts its motors.

    in FOLLOW, no setpoint for hold_s             HOLD: it comes to rest ahead, and stays there
    in CLIMB, HOLD or FOLLOW, no order for land_s  LAND
    LAND                                          no order but KILL is obeyed until it stands
    off the ground, and not armed any more         DEAD: somebody else has cut the motors

All numbers are in the frame of the room.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from protocols.wire.vehicles import Kind, Mode, Order, Vector

STREAM_S = 0.02  # between two setpoints
_SOON_S = 0.014  # a fresh setpoint that comes so soon after the last waits for its turn
_AGAIN_S = 0.2  # what is not followed is said again
_LANDING_SAID = 5  # times: once is lost now and then, and without a plan its motors stop
_ARMING_SAID = 50  # an autopilot wants to be told where to be for a second before
_CLIMBING_SAID = 3
_LOW_M, _THERE_M = 0.12, 0.1
_UNARMED_S = 0.5
_STILL: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Limits:
    """After how long a silence it holds, and lands [s]; how fast it climbs and sinks [m/s]; how hard it brakes [m/s²]; how much
    longer than that a climb or a landing may take [s]."""

    hold_s: float = 0.15
    land_s: float = 1.0
    climb_mps: float = 0.5
    sink_mps: float = 0.3
    braking_mps2: float = 2.0
    patience_s: float = 3.0


class Seen(NamedTuple):
    """What a vehicle says of itself. at: when it was heard [s]."""

    at: float
    p: Vector
    v: Vector
    yaw: float
    tilt: float
    battery: float
    armed: bool
    arms_itself: bool
    flying: bool
    locked: bool


class Arm(NamedTuple):
    """Let the motors run, or no more."""

    on: bool


class TakeOff(NamedTuple):
    """Climb by itself to a height [m] in so many seconds."""

    height: float
    duration_s: float


class Stream(NamedTuple):
    """A setpoint."""

    p: Vector
    v: Vector
    a: Vector
    yaw: float


class Land(NamedTuple):
    """Come down by itself in so many seconds, whatever it was told before."""

    duration_s: float


class Cut(NamedTuple):
    """Stop the motors."""


Act = Arm | TakeOff | Stream | Land | Cut


class Keeper:
    """Keeps one vehicle. Times are seconds of one clock that never goes back.

    Attributes:
        mode: what it does. armed: whether its drone has armed it. followed: number of the order that is obeyed.
    """

    def __init__(self, limits: Limits) -> None:
        self.mode, self.armed, self.followed = Mode.GROUND, False, -1
        self._limits = limits
        self._order = Order(Kind.NOTHING, -1)
        self._heard_at = self._setpoint_at = self._armed_at = -math.inf
        self._since = self._said_at = self._streamed_at = -math.inf
        self._said = 0  # how often what this mode begins with was said
        self._arming = self._disarming = False  # what is said until it is so
        self._duration_s = self._start_height = self._height = 0.0
        self._rest = Stream(_STILL, _STILL, _STILL, 0.0)

    def hear(self, order: Order, now: float) -> None:
        """An order came. One that is older than what was heard already is dropped; after a silence numbers begin anew."""
        if now - self._heard_at > self._limits.land_s and order.number != self._order.number:
            self.followed = order.number - 1
        elif order.number < self._order.number:
            return
        self._heard_at = now
        if order.number != self._order.number:
            self._order = order
            if order.kind is Kind.FLY:
                self._setpoint_at = now

    def act(self, seen: Seen, now: float) -> list[Act]:
        """What is said to the vehicle now; ask every `STREAM_S` and when an order came."""
        self._move_on(seen, now)
        match self.mode:
            case Mode.GROUND:
                return self._on_ground(seen, now)
            case Mode.CLIMB:
                rising = seen.p[2] > self._start_height + _LOW_M
                return (
                    []
                    if rising or not self._due(now, _CLIMBING_SAID)
                    else [TakeOff(self._height, self._duration_s)]
                )
            case Mode.HOLD:
                return self._streamed(self._rest, now, STREAM_S)
            case Mode.FOLLOW:
                _, _, p, v, a, yaw = self._order
                fresh = self._setpoint_at > self._streamed_at
                return self._streamed(Stream(p, v, a, yaw), now, _SOON_S if fresh else STREAM_S)
            case Mode.LAND:
                return [Land(self._duration_s)] if self._due(now, _LANDING_SAID) else []
            case Mode.DEAD:
                return [Cut()] if self._due(now, math.inf) else []

    # Transitions

    def _move_on(self, seen: Seen, now: float) -> None:
        kind, silent = self._order.kind, now - self._heard_at
        if self.mode is Mode.DEAD:
            return
        self._armed_at = now if seen.armed else self._armed_at
        cut = seen.locked or (now - self._armed_at > _UNARMED_S and self.mode is not Mode.LAND)
        if kind is Kind.KILL or (cut and self.mode is not Mode.GROUND):
            self._follow(Mode.DEAD, now)
        elif self.mode is Mode.GROUND:
            self._leave_ground(seen, now, silent)
            return
        elif self.mode is Mode.LAND:
            self._touch_down(seen, now)
        elif kind is Kind.LAND or silent > self._limits.land_s:
            self._land(seen, now)
        elif self.mode is Mode.CLIMB:
            self._climb(seen, now)
        elif self.mode is Mode.HOLD:
            if kind is Kind.FLY and now - self._setpoint_at <= self._limits.hold_s:
                self._follow(Mode.FOLLOW, now)
        elif kind is Kind.HOLD or now - self._setpoint_at > self._limits.hold_s:
            self._come_to_rest(seen, now)
        self.followed = self._order.number

    def _leave_ground(self, seen: Seen, now: float, silent: float) -> None:
        if silent > self._limits.land_s or self._order.number <= self.followed:
            return
        if self._order.kind is Kind.TAKE_OFF and self.armed and seen.armed and not seen.flying:
            self._height, self._start_height = self._order.p[2], seen.p[2]
            self._duration_s = max(0.5, (self._height - seen.p[2]) / self._limits.climb_mps)
            self._follow(Mode.CLIMB, now)
        elif self._order.kind is Kind.ARM:
            self.armed = self._arming = True
            self._disarming = False
            self._follow(Mode.GROUND, now)
        elif self._order.kind is Kind.LAND:
            self._stand(now)

    def _climb(self, seen: Seen, now: float) -> None:
        there = abs(seen.p[2] - self._height) < _THERE_M and now - self._since >= self._duration_s
        if there and self._order.kind is not Kind.HOLD:
            self._rest = Stream((seen.p[0], seen.p[1], self._height), _STILL, _STILL, seen.yaw)
            self._follow(Mode.HOLD, now)
        elif self._order.kind is Kind.HOLD:
            self._come_to_rest(seen, now)
        elif now - self._since > self._duration_s + self._limits.patience_s:
            self._land(seen, now)

    def _come_to_rest(self, seen: Seen, now: float) -> None:
        """Ahead, where it can stop."""
        ahead = math.hypot(*seen.v) / (2 * self._limits.braking_mps2)
        (x, y, z), (vx, vy, vz) = seen.p, seen.v
        self._rest = Stream((x + ahead * vx, y + ahead * vy, z + ahead * vz), _STILL, _STILL, seen.yaw)
        self._follow(Mode.HOLD, now)

    def _land(self, seen: Seen, now: float) -> None:
        self._duration_s = max(1.0, seen.p[2] / self._limits.sink_mps)
        self._follow(Mode.LAND, now)

    def _touch_down(self, seen: Seen, now: float) -> None:
        passed = now - self._since - self._duration_s
        if passed > 0 and (seen.p[2] < _LOW_M or not seen.flying or passed > self._limits.patience_s):
            self._stand(now)

    def _stand(self, now: float) -> None:
        self.armed, self._disarming = False, True
        self._follow(Mode.GROUND, now)

    def _follow(self, mode: Mode, now: float) -> None:
        self.mode, self._since, self._said, self._said_at = mode, now, 0, -math.inf
        self.followed = self._order.number

    # What is said

    def _on_ground(self, seen: Seen, now: float) -> list[Act]:
        # One that arms itself would do so again at once; and one that was found in the air is somebody else's.
        disarms = self._disarming and seen.armed and not (seen.arms_itself or seen.flying)
        # One that disarms itself, as autopilots do that are not taken off, is not armed again unasked.
        self._arming = self._arming and self.armed and not seen.armed
        if seen.locked or not (disarms or self._arming):
            return []
        return [Arm(self.armed)] if self._due(now, _ARMING_SAID) else []

    def _due(self, now: float, times: float) -> bool:
        if self._said >= times or now - self._said_at < _AGAIN_S:
            return False
        self._said, self._said_at = self._said + 1, now
        return True

    def _streamed(self, setpoint: Stream, now: float, soonest_s: float) -> list[Act]:
        if now - self._streamed_at < soonest_s:
            return []
        self._streamed_at = now
        return [setpoint]
