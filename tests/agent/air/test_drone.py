"""A fleet flies its mission in a hall without a world."""

import math

import pytest

from agent.air.pilot import Phase
from protocols.wire.operator import Order
from tests.agent.air.hall import Hall, plan_of


@pytest.fixture(scope="module")
def flown() -> Hall:
    hall = Hall(plan_of())
    hall.go(0.0)
    hall.wait(30.0, {Phase.GROUND})
    return hall


def test_six_points_fly_the_lab_mission_and_land(flown: Hall) -> None:
    for drone in flown.drones:
        phases = [phase for _, phase, _ in drone.events]
        assert phases == [Phase.ARMED, Phase.CLIMB, Phase.FORM, Phase.FLY, Phase.LAND, Phase.GROUND]
        assert drone.missed == 0
    assert flown.closest_m >= flown.plan.limit_m


def test_they_stand_in_formation_when_the_mission_is_over(flown: Hall) -> None:
    slots = flown.plan.slots_at(flown.plan.ticks)
    log = flown.drones[0].log
    places = [flown.plan.place.to_room(tuple(p)) for p in log.positions[flown.plan.ticks]]
    errors = [
        math.dist(place, slots[slot]) for place, slot in zip(places, log.slots[flown.plan.ticks], strict=True)
    ]
    assert max(errors) <= 0.15
    assert sorted(log.slots[flown.plan.ticks]) == list(range(6))


def test_nobody_moves_before_go(flown: Hall) -> None:
    hall = Hall(plan_of())
    hall.up()
    before = hall.truth[-1]
    hall.wait(1.0)
    assert all(math.dist(a, b) < 0.05 for a, b in zip(before, hall.truth[-1], strict=True))
    hall.order(Order.ABORT)
    hall.wait(10.0, {Phase.GROUND})
    assert hall.phases == {Phase.GROUND}


def test_who_misses_somebody_when_it_is_to_be_armed_is_armed_when_it_hears_all() -> None:
    hall = Hall(plan_of(), loses=lambda who, to, now: to == 2 and who == "4" and 1000.4 < now < 1002.0)
    hall.wait(1.0)
    hall.order(Order.ARM)
    hall.wait(0.5)
    assert hall.phases == {Phase.GROUND, Phase.ARMED}
    hall.wait(2.0, {Phase.ARMED})
    assert hall.phases == {Phase.ARMED}


def test_who_was_disarmed_is_not_armed_again_by_the_same_word() -> None:
    hall = Hall(plan_of())
    hall.wait(1.0)
    hall.order(Order.ARM)
    hall.wait(0.3)
    assert hall.phases == {Phase.ARMED}
    hall.drones[1].land()
    hall.wait(1.0)
    assert [drone.pilot.phase for drone in hall.drones].count(Phase.GROUND) == 1


def test_who_misses_a_fifth_of_its_ticks_is_not_armed_until_its_machine_has_time() -> None:
    hall = Hall(plan_of())
    hall.wait(1.0)
    everybody, slow = set(hall.alive), hall.drones[1]
    for tick in range(500):
        hall.alive = everybody - {1} if tick % 2 else everybody
        hall.tick()
    hall.alive = everybody
    (complaint,) = slow.complaints(slow.vehicle.state(), hall.now)
    assert complaint.startswith("it misses 32 % of its ticks: its machine is too busy")
    hall.order(Order.ARM)
    hall.wait(1.0)
    assert [drone.me for drone in hall.drones if drone.pilot.phase is Phase.GROUND] == [1]
    hall.wait(5.0)
    assert slow.complaints(slow.vehicle.state(), hall.now) == []


@pytest.mark.parametrize(("lasts_s", "lands"), [(1.0, False), (3.0, True)])
def test_a_battery_that_sags_for_a_moment_lands_nobody(lasts_s: float, lands: bool) -> None:
    """As all do while motors spin up."""
    hall = Hall(plan_of())
    hall.go(0.0)
    one = hall.vehicles[1]
    one._battery, before = 0.1, one._battery
    hall.wait(lasts_s)
    one._battery = before
    hall.wait(1.0)
    assert (hall.drones[1].pilot.phase is Phase.LAND) == lands
    if lands:
        assert hall.drones[1].pilot.reasons == ("battery at 10 % for 2.0 s",)
