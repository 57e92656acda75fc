"""The physics of a Crazyflie 2, as little of it as its firmware needs to fly: a rigid body with four rotors, above a floor.

Numbers are of Landry (2015) and Förster (2015) and of the firmware's own tables; body frame x forward, y left, z up.
"""

import math

from tests.fakes.motion import GRAVITY, STILL, Vector

_MASS = 0.027  # kg
_INERTIA = (1.66e-5, 1.67e-5, 2.93e-5)  # kg m²
_ARM = 0.046 * math.sqrt(0.5)  # m, along each axis
_TORQUE = 0.006  # N m per N of thrust
_THRUST = (0.0915, 0.0677)  # N per square of the duty, and per duty, of each rotor
_DRAG = 0.01  # kg/s
_HARD_MPS = 1.5


class Quadrotor:
    """Attributes: p, v [m, m/s] in the room; q, its attitude (w, x, y, z); rates [rad/s] of the body; force: what its
    accelerometer feels [m/s²]; fell: how fast it met the floor when that was too fast [m/s]."""

    def __init__(self, p: Vector) -> None:
        self.p, self.v = p, STILL
        self.q = (1.0, 0.0, 0.0, 0.0)
        self.rates = STILL
        self.force: Vector = (0.0, 0.0, GRAVITY)
        self.fell = 0.0

    def step(self, duties: tuple[float, ...], dt: float) -> None:
        """Four duties from 0 to 1, in the order of the firmware: front right, back right, back left, front left."""
        one, two, three, four = (_THRUST[0] * duty * duty + _THRUST[1] * duty for duty in duties)
        total = one + two + three + four
        torques = (
            _ARM * (-one - two + three + four),
            _ARM * (-one + two + three - four),
            _TORQUE * (-one + two - three + four),
        )
        (ix, iy, iz), (p, q, r) = _INERTIA, self.rates
        turned = (
            p + dt * (torques[0] - (iz - iy) * q * r) / ix,
            q + dt * (torques[1] - (ix - iz) * p * r) / iy,
            r + dt * (torques[2] - (iy - ix) * p * q) / iz,
        )
        up = self._up()
        drag = tuple(-_DRAG * speed / _MASS for speed in self.v)
        push = tuple(total / _MASS * part + more for part, more in zip(up, drag, strict=True))
        a = push[0], push[1], push[2] - GRAVITY
        v = tuple(speed + dt * more for speed, more in zip(self.v, a, strict=True))
        at = tuple(place + dt * speed for place, speed in zip(self.p, v, strict=True))
        self.p, self.v, self.rates = (at[0], at[1], at[2]), (v[0], v[1], v[2]), turned
        self.force = self._to_body((push[0], push[1], push[2]))
        self._turn(dt)
        if self.p[2] <= 0.0:
            self._touch()

    def _touch(self) -> None:
        """It stands, level."""
        if self.v[2] < -_HARD_MPS:
            self.fell = -self.v[2]
        self.p, self.v, self.rates = (self.p[0], self.p[1], 0.0), STILL, STILL
        yaw = self.yaw
        self.q = math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)
        self.force = (0.0, 0.0, GRAVITY)

    @property
    def yaw(self) -> float:
        w, x, y, z = self.q
        return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))

    def _up(self) -> Vector:
        w, x, y, z = self.q
        return 2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)

    def _to_body(self, vector: Vector) -> Vector:
        w, x, y, z = self.q
        a, b, c = vector
        return (
            (1 - 2 * (y * y + z * z)) * a + 2 * (x * y + w * z) * b + 2 * (x * z - w * y) * c,
            2 * (x * y - w * z) * a + (1 - 2 * (x * x + z * z)) * b + 2 * (y * z + w * x) * c,
            2 * (x * z + w * y) * a + 2 * (y * z - w * x) * b + (1 - 2 * (x * x + y * y)) * c,
        )

    def _turn(self, dt: float) -> None:
        (w, x, y, z), (p, q, r) = self.q, self.rates
        turned = (
            w - 0.5 * dt * (x * p + y * q + z * r),
            x + 0.5 * dt * (w * p + y * r - z * q),
            y + 0.5 * dt * (w * q - x * r + z * p),
            z + 0.5 * dt * (w * r + x * q - y * p),
        )
        size = math.sqrt(sum(part * part for part in turned))
        self.q = turned[0] / size, turned[1] / size, turned[2] / size, turned[3] / size
