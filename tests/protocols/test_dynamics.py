"""The double integrator with its limits, against the paper's three lines."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols.dynamics import clip_ball, integrate

DT = 0.01
NUMBER = st.floats(-50, 50)


def test_what_is_within_the_ball_stays_as_it_is() -> None:
    assert clip_ball(3.0, -4.0, 5.0) == (3.0, -4.0)


def test_what_is_outside_is_shortened_in_its_direction() -> None:
    assert clip_ball(6.0, 8.0, 5.0) == pytest.approx((3.0, 4.0))


def test_position_follows_by_the_trapezoidal_rule() -> None:
    place, speed = integrate((1.0, 2.0), (3.0, -1.0), (2.0, 4.0), 10.0, 10.0, DT)
    assert speed == pytest.approx((3.02, -0.96))
    assert place == pytest.approx((1.0 + DT * 3.01, 2.0 - DT * 0.98), abs=1e-15)


def test_acceleration_is_limited_before_speed() -> None:
    _, speed = integrate((0.0, 0.0), (9.95, 0.0), (30.0, 40.0), 10.0, 10.0, DT)
    # 50 m/s^2 become 10; the speed that results lies outside and is projected onto the ball.
    wx, wy = 9.95 + 0.06, 0.08
    shrink = 10.0 / math.hypot(wx, wy)
    assert speed == pytest.approx((wx * shrink, wy * shrink))


@given(px=NUMBER, py=NUMBER, vx=st.floats(-7, 7), vy=st.floats(-7, 7), ax=NUMBER, ay=NUMBER)
def test_no_step_breaks_a_limit(px: float, py: float, vx: float, vy: float, ax: float, ay: float) -> None:
    (qx, qy), (wx, wy) = integrate((px, py), (vx, vy), (ax, ay), 10.0, 10.0, DT)
    assert math.hypot(wx, wy) <= 10.0 + 1e-9
    assert math.hypot(wx - vx, wy - vy) <= 10.0 * DT + 1e-9
    assert (qx - px, qy - py) == pytest.approx((DT / 2 * (vx + wx), DT / 2 * (vy + wy)), abs=1e-12)
