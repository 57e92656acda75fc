"""``point:``, a vehicle without hardware: a double integrator of its own, with the manners and the failsafe of a real one.

It lives in the process that flies it. What goes wrong with it in a test or a demonstration is written behind the colon, each at
so many seconds after it left the ground: ``point:frozen@6`` (its position is measured no more), ``jump@6`` (from then on its
position is measured 2 m beside where it is), ``empty@6`` (battery at 5 %), ``tilted@6`` (it lies on its side), ``gust@6`` (the
wind blows it along y at 1 m/s, whatever it does).
"""

import math
import re
import time
from collections.abc import Callable
from enum import StrEnum

from agent.air.vehicle import Mode, Rig, Setpoint, State, Vector, VehicleAddressError

_STEP_S = 0.01
_STIFFNESS, _DAMPING = 16.0, 8.0  # critically damped, settles in a second
_CLIMB_MPS, _SINK_MPS = 0.5, 0.3
_GRAVITY = 9.81
_THERE_M, _THERE_MPS = 0.03, 0.1
_JUMP_M, _GUST_MPS = 2.0, 1.0
_DRAIN_PER_S = 1 / 900  # a quarter of an hour in the air
_FAULT = re.compile(r"([a-z]+)@(\d+(?:\.\d+)?)")


class Trouble(StrEnum):
    """What can go wrong with it."""

    FROZEN = "frozen"
    JUMP = "jump"
    EMPTY = "empty"
    TILTED = "tilted"
    GUST = "gust"


class PointVehicle:
    """As agent.air.vehicle.Vehicle has it."""

    lags = False

    def __init__(self, where: str, rig: Rig, now: Callable[[], float] = time.monotonic) -> None:
        """``where``: faults, as above, with commas between.

        Raises:
            VehicleAddressError: ``where`` is none.
        """
        self._rig, self._now = rig, now
        self._troubles = _troubles(where)
        self._p, self._v, self._a = rig.start, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        self._goal = rig.start
        self._measured, self._measured_at = rig.start, 0.0
        self._setpoint = Setpoint(rig.start, self._v, self._v)
        self._mode, self._armed, self._battery = Mode.GROUND, False, 1.0
        self._at = self._told_at = now()
        self._left_ground_at = math.inf
        self._abandoned = False  # it holds because nobody leads it

    def open(self, timeout_s: float) -> None:
        self._at = self._measured_at = self._now()

    def state(self) -> State:
        self._move_on()
        troubled = self._troubled
        if not troubled(Trouble.FROZEN):
            x, y, z = self._p
            self._measured = (x + _JUMP_M * troubled(Trouble.JUMP), y, z)
            self._measured_at = self._at
        return State(
            p=self._measured,
            v=self._v,
            yaw=0.0,
            tilt=math.pi / 2 if troubled(Trouble.TILTED) else math.atan2(math.hypot(*self._a[:2]), _GRAVITY),
            age_s=self._at - self._measured_at,
            battery=0.05 if troubled(Trouble.EMPTY) else self._battery,
            mode=self._mode,
            armed=self._armed,
        )

    def arm(self) -> None:
        self._move_on()
        if self._mode is Mode.GROUND:
            self._armed = True

    def take_off(self, height: float) -> None:
        self._move_on()
        if self._armed and self._mode is Mode.GROUND:
            self._mode, self._goal, self._left_ground_at = Mode.CLIMB, (*self._p[:2], height), self._at

    def fly(self, setpoint: Setpoint) -> None:
        self._move_on()
        if self._mode in (Mode.HOLD, Mode.FOLLOW):
            self._mode, self._setpoint, self._told_at = Mode.FOLLOW, setpoint, self._at

    def hold(self) -> None:
        self._move_on()
        if self._mode in (Mode.CLIMB, Mode.FOLLOW, Mode.HOLD):
            self._stop(Mode.HOLD)

    def land(self) -> None:
        self._move_on()
        if self._mode in (Mode.CLIMB, Mode.FOLLOW, Mode.HOLD):
            self._stop(Mode.LAND)
        elif self._mode is Mode.GROUND:
            self._armed = False

    def kill(self) -> None:
        self._move_on()
        self._mode, self._armed = Mode.DEAD, False

    def close(self) -> None:
        pass

    def _troubled(self, trouble: Trouble) -> bool:
        return self._at - self._left_ground_at >= self._troubles.get(trouble, math.inf)

    def _stop(self, mode: Mode) -> None:
        """From here on ``mode``, where it comes to rest."""
        self._abandoned = False
        speed, braking = math.hypot(*self._v), 0.5 * self._rig.acceleration_mps2
        self._mode = mode
        self._goal = _sum(self._p, self._v, speed / (2 * braking))

    def _move_on(self) -> None:
        """Fly until now."""
        now = self._now()
        while self._at < now:
            dt = min(_STEP_S, now - self._at)
            self._at += dt
            self._watch()
            self._step(dt)

    def _watch(self) -> None:
        """The failsafe; and what follows when a manoeuvre is done."""
        silent, mode = self._at - self._told_at, self._mode
        if mode is Mode.FOLLOW and silent > self._rig.failsafe.hold_s:
            self._stop(Mode.HOLD)
            self._abandoned = True
        elif mode is Mode.HOLD and self._abandoned and silent > self._rig.failsafe.land_s:
            self._stop(Mode.LAND)
        elif (
            mode is Mode.CLIMB
            and math.dist(self._p, self._goal) < _THERE_M
            and math.hypot(*self._v) < _THERE_MPS
        ):
            self._mode = Mode.HOLD
        elif mode is Mode.LAND and self._p[2] <= 0.0:
            self._mode, self._armed = Mode.GROUND, False
            self._left_ground_at = math.inf

    def _step(self, dt: float) -> None:
        if self._mode is Mode.GROUND or (self._mode is Mode.DEAD and self._p[2] <= 0.0):
            self._p, self._v, self._a = (*self._p[:2], max(0.0, self._p[2])), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
            return
        if self._mode is Mode.DEAD:
            self._a = (0.0, 0.0, -_GRAVITY)
        else:
            self._battery = max(0.0, self._battery - _DRAIN_PER_S * dt)
            self._a = _clipped(self._wanted(), self._rig.acceleration_mps2)
        # Half again the limit of what is asked for: what corrects errors must be able to catch up.
        fastest = math.inf if self._mode is Mode.DEAD else 1.5 * self._rig.speed_mps
        v = _clipped(_sum(self._v, self._a, dt), fastest)
        x, y, z = _sum(_sum(self._p, self._v, dt / 2), v, dt / 2)
        if self._troubled(Trouble.GUST):
            y, v = self._p[1] + dt * _GUST_MPS, (v[0], _GUST_MPS, v[2])
        self._p, self._v = (x, y, max(0.0, z)), v

    def _wanted(self) -> Vector:
        """The acceleration that its controller wants."""
        if self._mode is Mode.FOLLOW:
            p, v, a, _ = self._setpoint
            late = self._at - self._told_at
            p, v = _sum(p, v, late), _sum(v, a, late)
        else:
            a, v = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
            fastest = _CLIMB_MPS if self._mode is Mode.CLIMB else self._rig.speed_mps
            if self._mode is Mode.LAND:
                p, v = (*self._goal[:2], self._p[2]), (0.0, 0.0, -_SINK_MPS)
            else:
                ahead = _clipped(_sum(self._goal, self._p, -1.0), fastest * _DAMPING / _STIFFNESS)
                p = _sum(self._p, ahead, 1.0)
        return _sum(_sum(a, _sum(p, self._p, -1.0), _STIFFNESS), _sum(v, self._v, -1.0), _DAMPING)


def _troubles(where: str) -> dict[Trouble, float]:
    found = {}
    for word in filter(None, where.split(",")):
        match = _FAULT.fullmatch(word)
        if not match or match[1] not in set(Trouble):
            raise VehicleAddressError(
                f"point:{where}: {word!r} is nothing that goes wrong with a point; write one of "
                f"{', '.join(Trouble)} and when, for example frozen@6, or nothing behind the colon"
            )
        found[Trouble(match[1])] = float(match[2])
    return found


def _sum(a: Vector, b: Vector, factor: float) -> Vector:
    """a + factor b."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


def _clipped(vector: Vector, longest: float) -> Vector:
    length = math.hypot(*vector)
    return vector if length <= longest else _sum((0.0, 0.0, 0.0), vector, longest / length)
