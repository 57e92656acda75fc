"""What an autopilot says that speaks against flying it, by the real pymavlink: its failsafe, its own checks, its estimator."""

import pytest

pytest.importorskip("pymavlink", reason="the extra 'mavlink' is not installed")

from tests.agent.air.led import START, Flight
from tests.fakes.autopilot import FakeAutopilot, Make

both = pytest.mark.parametrize("make", list(Make))


@both
def test_one_whose_failsafe_is_none_says_what_to_set(make: Make) -> None:
    flight = Flight(FakeAutopilot(make, START, tuned=False))
    flight.vehicle.open(3.0)
    health = flight.wait(1.0).health
    assert (
        health
        == {
            Make.PX4: ("COM_OBL_RC_ACT is 0: set it to 4 (it lands when setpoints stop)",),
            Make.ARDUPILOT: (
                "GUID_TIMEOUT is 3: set it to 0.5 (so many seconds after the last setpoint it stops)",
                "FS_GCS_ENABLE is 0: set it to 5 (it lands when this computer falls silent)",
                "FS_GCS_TIMEOUT is 5: set it to 2 (so many seconds after that)",
            ),
        }[make]
    )


@both
def test_one_that_refuses_to_be_armed_says_so(make: Make) -> None:
    fake = FakeAutopilot(make, START)
    fake.battery = 0.1
    flight = Flight(fake)
    flight.vehicle.open(3.0)
    flight.vehicle.arm()
    state = flight.wait(3.0)
    assert not state.armed
    assert state.health == ("it refuses to be armed",)
    assert state.battery == pytest.approx(0.1)


@both
def test_one_that_does_not_know_where_it_is_yet_says_so_before_it_is_armed(make: Make) -> None:
    """As PX4's firmware does for seconds after it was switched on: it says a position all the same, which it made up."""
    fake = FakeAutopilot(make, START)
    fake.guesses = True
    flight = Flight(fake)
    flight.vehicle.open(3.0)
    state = flight.wait(2.0)
    assert state.health == (
        "its estimator does not know where it is: give it time, or look at what measures its position",
    )
    assert state.age_s > 0.5
    fake.guesses = False
    state = flight.wait(0.5)
    assert state.health == ()
    assert state.age_s < 0.05


@both
def test_one_that_loses_its_place_in_flight_has_an_old_position(make: Make) -> None:
    fake = FakeAutopilot(make, START)
    flight = Flight(fake)
    flight.climb()
    fake.guesses = True
    assert flight.wait(0.3).age_s < 0.05  # it may be back at once
    assert flight.wait(1.0).age_s > 0.5


def test_what_its_own_checks_say_is_told_before_it_is_armed() -> None:
    """ArduPilot says which; PX4 says so only to a ground station."""
    fake = FakeAutopilot(Make.ARDUPILOT, START)
    fake.fails = "Compass not calibrated"
    flight = Flight(fake)
    flight.vehicle.open(3.0)
    assert flight.wait(4.0).health == ("its own checks do not pass: PreArm: Compass not calibrated",)
    fake.fails = ""
    assert flight.wait(1.5).health == ()
