"""How a fake moves: a point in three dimensions with limited acceleration, above a floor."""

import math
from dataclasses import dataclass

GRAVITY = 9.81
Vector = tuple[float, float, float]
STILL: Vector = (0.0, 0.0, 0.0)

_STIFFNESS, _DAMPING = 36.0, 12.0  # 1/s², 1/s: critically damped
_MOST_ACCELERATION = 8.0  # m/s²: a tilt of 40 degrees
_DRAG = 0.3  # 1/s
_HARD_MPS = 1.5  # who meets the floor faster than this has fallen


@dataclass(frozen=True)
class Lag:
    """How late somebody follows along the floor: stiffness [1/s²], damping [1/s], and how long until it is tilted [s]."""

    stiffness: float = _STIFFNESS
    damping: float = _DAMPING
    tilt_s: float = 0.0


@dataclass(frozen=True)
class Goal:
    """What a controller is to follow: position [m], velocity [m/s], acceleration [m/s²]; with a None it does not care where."""

    p: tuple[float | None, float | None, float | None]
    v: Vector = STILL
    a: Vector = STILL
    yaw: float = 0.0


@dataclass
class Motion:
    """Where it is, in metres, z up; ``fell``: how fast it met the floor when that was too fast [m/s]."""

    p: Vector
    v: Vector = STILL
    a: Vector = STILL
    yaw: float = 0.0
    fell: float = 0.0
    lag: Lag = Lag()

    def fly(self, goal: Goal, dt: float) -> None:
        """Follow ``goal`` for ``dt``. Where it says None, speed is followed (drifting, where that is zero)."""
        wanted = []
        for axis, (p, v, to_p, to_v, to_a) in enumerate(
            zip(self.p, self.v, goal.p, goal.v, goal.a, strict=True)
        ):
            lag = self.lag if axis < 2 else Lag()
            if to_p is None:
                wanted.append(-_DRAG * v if to_v == 0.0 else to_a + lag.damping * (to_v - v))
            else:
                wanted.append(to_a + lag.stiffness * (to_p - p) + lag.damping * (to_v - v))
        if self.lag.tilt_s:
            share = min(1.0, dt / self.lag.tilt_s)
            wanted[:2] = [a + share * (to_a - a) for a, to_a in zip(self.a, wanted[:2], strict=False)]
        size = math.hypot(*wanted)
        factor = min(1.0, _MOST_ACCELERATION / size) if size else 1.0
        self.yaw = goal.yaw
        self._move((wanted[0] * factor, wanted[1] * factor, wanted[2] * factor), dt)

    def drop(self, dt: float) -> None:
        """Motors off for ``dt``."""
        x, y, z = self.v
        self._move((-_DRAG * x, -_DRAG * y, -GRAVITY - _DRAG * z), dt)

    def _move(self, a: Vector, dt: float) -> None:
        v = tuple(speed + more * dt for speed, more in zip(self.v, a, strict=True))
        p = tuple(at + 0.5 * (old + new) * dt for at, old, new in zip(self.p, self.v, v, strict=True))
        self.p, self.v, self.a = (p[0], p[1], p[2]), (v[0], v[1], v[2]), a
        if self.p[2] <= 0.0:
            if self.v[2] < -_HARD_MPS:
                self.fell = -self.v[2]
            self.p, self.v, self.a = (self.p[0], self.p[1], 0.0), STILL, STILL

    @property
    def tilt(self) -> Vector:
        """Roll and pitch [rad] that this acceleration takes, for a vehicle that looks along x; and yaw."""
        return -math.atan2(self.a[1], GRAVITY), math.atan2(self.a[0], GRAVITY), self.yaw
