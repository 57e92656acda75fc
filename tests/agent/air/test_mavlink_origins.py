"""Autopilots that know their place by satellites, each by an origin of its own, fly in one room all the same."""

import pytest

pytest.importorskip("pymavlink", reason="the extra 'mavlink' is not installed")

from agent.air.vehicle import Mode, VehicleError
from tests.agent.air.led import HEIGHT, START, Flight
from tests.fakes.autopilot import FakeAutopilot, Make


@pytest.mark.parametrize("make", Make)
def test_all_of_a_fleet_get_one_origin(make: Make) -> None:
    fake = FakeAutopilot(make, START)
    flight = Flight(fake, origin="47.3977, 8.5456, 488")
    flight.vehicle.open(3.0)
    assert flight.wait(1.0).health == ()
    assert fake.origin == (473977000, 85456000, 488000)


def test_one_that_has_its_origin_from_satellites_flies_in_the_room_all_the_same() -> None:
    """As ArduPilot's firmware does: it keeps its own, and answers nothing."""
    fake = FakeAutopilot(Make.ARDUPILOT, START)
    fake.origin, fake.lies = (473977180, 85455341, 471000), (-4.97, 2.00, 0.0)
    flight = Flight(fake, origin="47.3977, 8.5456, 488")
    flight.climb()
    assert flight.wait(0.1).p == pytest.approx(fake.motion.p, abs=0.05)
    assert flight.go((2.0, 1.0), 4.0) < 0.3
    assert fake.origin == (473977180, 85455341, 471000)


@pytest.mark.parametrize("make", Make)
def test_heights_count_from_the_ground_where_it_stands_whatever_satellites_say(make: Make) -> None:
    """The origin in the fleet file is from a map, and what satellites say of heights is metres off."""
    fake = FakeAutopilot(make, START)
    fake.higher = 2.7
    flight = Flight(fake, origin="47.3977, 8.5456, 488")
    flight.vehicle.open(3.0)
    assert flight.wait(1.0).p == pytest.approx(START, abs=0.01)
    flight.climb()
    assert fake.motion.p[2] == pytest.approx(HEIGHT, abs=0.1)
    flight.go((1.0, 0.0), 3.0)
    assert fake.motion.p[2] == pytest.approx(HEIGHT, abs=0.1)
    flight.vehicle.land()
    flight.until(lambda state: state.mode is Mode.GROUND)
    assert not fake.fell


def test_one_whose_satellites_come_late_is_led_from_where_they_say() -> None:
    """As ArduPilot's firmware does: it says that it took the room's origin, and then takes its own without a word."""
    fake = FakeAutopilot(Make.ARDUPILOT, START)
    flight = Flight(fake, origin="47.3977, 8.5456, 488")
    flight.vehicle.open(3.0)
    fake.origin, fake.lies = (473977180, 85455341, 488000), (-4.97, 2.00, 0.0)
    assert flight.wait(2.0).p == pytest.approx(START, abs=0.05)


def test_an_origin_of_elsewhere_is_told() -> None:
    fake = FakeAutopilot(Make.ARDUPILOT, START)
    fake.origin = (474977000, 85456000, 488000)
    flight = Flight(fake, origin="47.3977, 8.5456, 488")
    flight.vehicle.open(3.0)
    (ill,) = flight.wait(1.0).health
    assert ill.startswith("its origin is 1113")


def test_who_knows_no_origin_knows_no_place() -> None:
    fake = FakeAutopilot(Make.ARDUPILOT, START)
    flight = Flight(fake, origin="47.3977, 8.5456, 488")
    flight.wire.mav.set_gps_global_origin_send = lambda *_: None
    with pytest.raises(VehicleError, match="says no origin of its place"):
        flight.vehicle.open(3.0)
