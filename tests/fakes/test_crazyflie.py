"""The fake Crazyflie does what the firmware does when it is led badly, in a time of its own."""

import math

import pytest

from tests.fakes.crazyflie import FakeCrazyflie, Stage
from tests.fakes.packets import (
    ARM,
    EMERGENCY_STOP,
    NO_THRUST,
    NOTIFY_STOP,
    STOP_PLAN,
    land,
    setpoint,
    take_off,
)


@pytest.fixture
def flying() -> FakeCrazyflie:
    """One that was led to 1 m and is told to stay there."""
    fake = FakeCrazyflie()
    fake.take(take_off(1.0, 1.5))
    fake.advance(2.0)
    stream(fake, 1.0)
    return fake


def stream(fake: FakeCrazyflie, seconds: float) -> None:
    for _ in range(round(50 * seconds)):
        fake.take(setpoint((0.0, 0.0, 1.0)))
        fake.advance(0.02)


def test_it_takes_off_by_itself_and_follows_setpoints(flying: FakeCrazyflie) -> None:
    assert flying.stage is Stage.FLYING
    assert math.dist(flying.motion.p, (0.0, 0.0, 1.0)) < 0.01


def test_without_setpoints_it_levels_and_after_2_s_it_falls(flying: FakeCrazyflie) -> None:
    flying.advance(0.4)
    assert flying.stage is Stage.FLYING
    flying.advance(0.2)
    assert flying.stage is Stage.LEVELLING
    flying.advance(1.3)
    assert flying.stage is Stage.LEVELLING
    assert flying.motion.p[2] > 0.95
    flying.advance(1.0)
    assert flying.stage is Stage.LOCKED
    assert flying.motion.fell > 2.0
    stream(flying, 1.0)
    assert flying.motion.p[2] == 0.0  # until it is switched off and on


def test_giving_way_to_a_high_level_commander_without_a_plan_is_a_fall(flying: FakeCrazyflie) -> None:
    flying.take(NOTIFY_STOP)
    flying.advance(1.0)
    assert flying.motion.fell


def test_giving_way_to_one_that_lands_is_a_landing(flying: FakeCrazyflie) -> None:
    for packet in (land(2.0), NOTIFY_STOP, land(2.0)):
        flying.take(packet)
    flying.advance(5.0)
    assert flying.motion.p[2] == 0.0
    assert not flying.motion.fell
    assert not flying.motors_on
    assert flying.stage is Stage.READY


def test_a_setpoint_makes_the_high_level_commander_forget_its_landing(flying: FakeCrazyflie) -> None:
    flying.take(land(2.0))
    stream(flying, 0.1)
    flying.take(NOTIFY_STOP)
    flying.advance(1.0)
    assert flying.motion.fell


def test_the_farewell_of_cflib_is_a_fall(flying: FakeCrazyflie) -> None:
    flying.take(NO_THRUST)
    flying.advance(1.0)
    assert flying.motion.fell


def test_an_emergency_stop_is_a_fall(flying: FakeCrazyflie) -> None:
    flying.take(EMERGENCY_STOP)
    flying.advance(1.0)
    assert flying.stage is Stage.LOCKED
    assert flying.motion.fell


def test_one_that_has_to_be_armed_does_nothing_before() -> None:
    fake = FakeCrazyflie(arms_itself=False)
    fake.take(take_off(1.0, 1.0))
    fake.advance(2.0)
    assert fake.motion.p[2] == 0.0
    fake.advance(1.0)
    assert fake.take(ARM) == [bytes([ARM[0], 0x81, 1, 1])]
    fake.take(STOP_PLAN)
    fake.take(take_off(1.0, 1.0))
    fake.advance(2.0)
    assert fake.motion.p[2] > 0.9


@pytest.mark.parametrize(
    "packet", [b"", b"\x70", b"\x70\x06short", b"\x20\x02\xff\xff", b"\xf1", b"\x50", bytes(31)]
)
def test_what_it_does_not_understand_it_does_not_answer(packet: bytes) -> None:
    FakeCrazyflie().take(packet)
