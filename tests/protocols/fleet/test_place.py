"""A mission laid in a room keeps its shape, whatever the room."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols.fleet.place import Flat, Place, ned_of, ned_yaw, way

numbers = st.floats(-1e3, 1e3)
points = st.tuples(numbers, numbers)
places = st.builds(Place, points, st.floats(-7.0, 7.0), st.floats(0.25, 1.0))


def near(a: Flat, b: Flat) -> bool:
    return math.dist(a, b) < 1e-6


@given(places, points)
def test_there_and_back(place: Place, point: Flat) -> None:
    assert near(place.to_mission(place.to_room(point)), point)
    assert near(place.turned_back(place.turned(point)), point)


@given(places, points, points)
def test_distances_scale(place: Place, a: Flat, b: Flat) -> None:
    assert math.isclose(
        math.dist(place.to_room(a), place.to_room(b)), place.scale * math.dist(a, b), abs_tol=1e-6
    )


@given(places, points, points)
def test_left_stays_left(place: Place, a: Flat, b: Flat) -> None:
    """No mirror: the area that two vectors span keeps its sign."""
    (ax, ay), (bx, by) = place.turned(a), place.turned(b)
    spanned = a[0] * b[1] - a[1] * b[0]
    assert math.isclose(ax * by - ay * bx, place.scale**2 * spanned, abs_tol=1e-5, rel_tol=1e-9)


@given(places, points, points, st.floats(0.0, 10.0))
def test_what_moves_in_the_mission_moves_alike_in_the_room(place: Place, p: Flat, v: Flat, t: float) -> None:
    later = place.to_room((p[0] + t * v[0], p[1] + t * v[1]))
    (x, y), (vx, vy) = place.to_room(p), place.turned(v)
    assert near(later, (x + t * vx, y + t * vy))


def test_forward_is_where_yaw_says() -> None:
    assert near(Place((1.0, 2.0), math.pi / 2, 0.5).to_room((2.0, 0.0)), (1.0, 3.0))


@given(st.tuples(numbers, numbers, numbers))
def test_ned_is_its_own_way_back(vector: tuple[float, float, float]) -> None:
    assert ned_of(ned_of(vector)) == vector


def test_north_east_down() -> None:
    assert ned_of((1.0, 2.0, 3.0)) == (2.0, 1.0, -3.0)


@given(st.floats(-math.pi, math.pi))
def test_a_heading_in_ned_points_the_same_way(yaw: float) -> None:
    north, east, _ = ned_of((math.cos(yaw), math.sin(yaw), 0.0))
    turned = ned_yaw(yaw)
    assert -math.pi < turned <= math.pi
    assert near((math.cos(turned), math.sin(turned)), (north, east))
    assert abs(math.remainder(ned_yaw(turned) - yaw, 2 * math.pi)) < 1e-9


@given(st.floats(-80, 80), st.floats(-180, 180), st.floats(-1e-3, 1e-3), st.floats(-1e-3, 1e-3))
def test_the_way_between_two_places_on_earth(
    latitude: float, longitude: float, north: float, east: float
) -> None:
    x, y = way((latitude, longitude), (latitude + north, longitude + east))
    assert y == pytest.approx(111_320 * north, rel=1e-3, abs=1e-4)
    assert x == pytest.approx(111_320 * east * math.cos(math.radians(latitude)), rel=2e-3, abs=1e-4)
    assert near(way((latitude + north, longitude + east), (latitude, longitude)), (-x, -y))


def test_a_way_over_the_date_line_is_short() -> None:
    assert way((0.0, 179.9999), (0.0, -179.9999))[0] == pytest.approx(22.26, abs=0.01)
