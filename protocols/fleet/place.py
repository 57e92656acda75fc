"""How a mission lies in a room: p_room = origin + R(yaw) * scale * p_mission.

A mission is of the plane: x forward, y left, metres of the mission. A room is of space: x east, y north, z up (ENU), metres; its
yaw is counted from x to y. Lengths, speeds and accelerations scale alike, for seconds are seconds in both. Autopilots speak
NED: north, east, down, yaw from north to east.
"""

import math
from typing import NamedTuple

_EARTH_M = 6_378_137.0

Flat = tuple[float, float]
Vector = tuple[float, float, float]


class Place(NamedTuple):
    """Where the mission's origin lies in the room [m], where its x points [rad], and room metres per mission metre."""

    origin: Flat
    yaw: float
    scale: float

    def to_room(self, point: Flat) -> Flat:
        """A point of the mission, in the room."""
        x, y = self.turned(point)
        return self.origin[0] + x, self.origin[1] + y

    def to_mission(self, point: Flat) -> Flat:
        """A point of the room, in the mission."""
        return self.turned_back((point[0] - self.origin[0], point[1] - self.origin[1]))

    def turned(self, vector: Flat) -> Flat:
        """A displacement, velocity or acceleration of the mission, in the room."""
        (x, y), c, s = vector, self.scale * math.cos(self.yaw), self.scale * math.sin(self.yaw)
        return c * x - s * y, s * x + c * y

    def turned_back(self, vector: Flat) -> Flat:
        """A displacement, velocity or acceleration of the room, in the mission."""
        (x, y), c, s = vector, math.cos(self.yaw) / self.scale, math.sin(self.yaw) / self.scale
        return c * x + s * y, c * y - s * x


def way(start: Flat, end: Flat) -> Flat:
    """From one place on earth to another near it, each a latitude and a longitude in degrees: metres east and north."""
    (latitude, longitude), (to_latitude, to_longitude) = start, end
    per_degree = math.radians(_EARTH_M)
    east = math.remainder(to_longitude - longitude, 360.0) * math.cos(
        math.radians(0.5 * (latitude + to_latitude))
    )
    return per_degree * east, per_degree * (to_latitude - latitude)


def ned_of(enu: Vector) -> Vector:
    """The same vector, for whoever speaks NED; and back."""
    east, north, up = enu
    return north, east, -up


def ned_yaw(yaw: float) -> float:
    """The same heading, counted from north to east, in (-pi, pi]; and back."""
    turned = math.remainder(math.pi / 2 - yaw, 2 * math.pi)
    return math.pi if turned == -math.pi else turned
