"""The vehicle without hardware has the manners of a real one."""

import math

import pytest

from agent.air.point import PointVehicle
from agent.air.vehicle import Mode, Rig, Setpoint, VehicleAddressError, make_vehicle

RIG = Rig(0, (1.0, 2.0, 0.0), speed_mps=2.0, acceleration_mps2=3.0)


class Room:
    """A point, and a time that passes when it is told to."""

    def __init__(self, where: str = "") -> None:
        self.time = 100.0
        self.point = PointVehicle(where, RIG, lambda: self.time)
        self.point.open(1.0)

    def wait(self, seconds: float) -> None:
        self.time += seconds
        self.point.state()

    def climb(self) -> None:
        self.point.arm()
        self.point.take_off(1.0)
        self.wait(6.0)

    def stream(self, seconds: float, speed: float = 1.0) -> None:
        """Setpoints at 50 Hz along x from where it is."""
        x, y, z = self.point.state().p
        for step in range(round(50 * seconds)):
            self.point.fly(Setpoint((x + speed * 0.02 * step, y, z), (speed, 0.0, 0.0), (0.0, 0.0, 0.0)))
            self.wait(0.02)


def test_it_climbs_where_it_stands_and_holds() -> None:
    room = Room()
    room.climb()
    state = room.point.state()
    assert state.mode is Mode.HOLD
    assert state.armed
    assert math.dist(state.p, (1.0, 2.0, 1.0)) < 0.05


def test_it_does_not_take_off_unarmed() -> None:
    room = Room()
    room.point.take_off(1.0)
    room.wait(3.0)
    assert room.point.state().mode is Mode.GROUND
    assert room.point.state().p[2] == 0.0


def test_it_follows_setpoints_closely() -> None:
    room = Room()
    room.climb()
    room.stream(3.0)
    state = room.point.state()
    assert state.mode is Mode.FOLLOW
    assert math.dist(state.p, (1.0 + 3.0, 2.0, 1.0)) < 0.1


def test_setpoints_that_stop_are_a_hold_and_then_a_landing() -> None:
    room = Room()
    room.climb()
    room.stream(2.0)
    room.wait(0.1)
    assert room.point.state().mode is Mode.FOLLOW
    room.wait(0.1)
    assert room.point.state().mode is Mode.HOLD
    room.wait(0.9)
    assert room.point.state().mode is Mode.LAND
    room.wait(6.0)
    landed = room.point.state()
    assert landed.mode is Mode.GROUND
    assert not landed.armed
    assert landed.p[2] == 0.0


def test_one_that_was_told_to_hold_holds() -> None:
    room = Room()
    room.climb()
    room.stream(2.0)
    room.point.hold()
    room.wait(20.0)
    assert room.point.state().mode is Mode.HOLD


def test_setpoints_do_not_stop_a_landing() -> None:
    room = Room()
    room.climb()
    room.point.land()
    room.stream(6.0)
    assert room.point.state().mode is Mode.GROUND


def test_one_that_is_killed_falls_and_obeys_no_more() -> None:
    room = Room()
    room.climb()
    room.point.kill()
    room.wait(1.0)
    room.point.arm()
    room.point.take_off(1.0)
    room.wait(3.0)
    state = room.point.state()
    assert state.mode is Mode.DEAD
    assert not state.armed
    assert state.p[2] == 0.0


@pytest.mark.parametrize("where", ["frozen@8", "jump@8", "empty@8", "tilted@8"])
def test_what_is_to_go_wrong_goes_wrong_then(where: str) -> None:
    room = Room(where)
    room.climb()
    well = room.point.state()
    assert well.age_s == 0.0
    assert well.battery > 0.9
    assert well.tilt < 0.3
    room.stream(3.0, speed=0.5)
    ill = room.point.state()
    assert {
        "frozen": ill.age_s > 0.5,
        "jump": ill.p[0] > 1.0 + 1.5 + 1.5,
        "empty": ill.battery < 0.1,
        "tilted": ill.tilt > 1.0,
    }[where.partition("@")[0]]


@pytest.mark.parametrize(
    "address", ["", "point", "balloon:", "point:frozen", "point:frozen@", "point:late@3", "point:frozen@-1"]
)
def test_an_address_that_is_none_is_refused_with_how_one_is_written(address: str) -> None:
    with pytest.raises(VehicleAddressError, match=r"for example (point:|frozen@6)"):
        make_vehicle(address, RIG)


def test_a_vehicle_is_found_by_its_kind() -> None:
    assert isinstance(make_vehicle("point:", RIG), PointVehicle)
