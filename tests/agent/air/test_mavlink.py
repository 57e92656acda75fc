"""Autopilots fly as they are told, through the real pymavlink; and what they do when whoever led them is gone.

Most flights are flown in simulated time: what pymavlink writes is handed to the fake, and the other way round.
"""

import math
import time
from collections.abc import Callable

import pytest

pytest.importorskip("pymavlink", reason="the extra 'mavlink' is not installed")

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.air.telemetry import Telemetry
from agent.air.vehicle import Failsafe, Mode, Rig, Setpoint, State, VehicleError, make_vehicle
from tests.agent.air.led import HEIGHT, START, WHERE, Flight
from tests.fakes.autopilot import FakeAutopilot, Make
from tests.fakes.udp import Wires, free_ports

both = pytest.mark.parametrize("make", list(Make))


@both
def test_it_flies_a_square_holds_and_lands(make: Make) -> None:
    fake = FakeAutopilot(make, START)
    flight = Flight(fake)
    flight.climb()
    assert math.dist(fake.motion.p, (START[0], START[1], HEIGHT)) < 0.15
    told, begun = fake.targets, flight.now
    worst = [flight.go(way, 3.0) for way in ((2.0, 0.0), (0.0, 2.0), (-2.0, 0.0), (0.0, -2.0))]
    assert max(worst) < 0.5  # corners
    assert (fake.targets - told) / (flight.now - begun) == pytest.approx(50, rel=0.02)
    state = flight.vehicle.state()
    assert state.mode is Mode.FOLLOW
    assert math.dist(state.p, fake.motion.p) < 0.1
    assert math.dist(state.v, fake.motion.v) < 0.2
    assert state.yaw == pytest.approx(0.5, abs=0.01)
    assert fake.motion.yaw == pytest.approx(0.5, abs=0.01)
    assert state.age_s < 0.05
    assert 0.9 < state.battery <= 1.0
    flight.vehicle.hold()
    held = flight.wait(6.0)
    assert held.mode is Mode.HOLD
    assert math.hypot(*held.v) < 0.05
    flight.vehicle.land()
    landed = flight.until(lambda state: state.mode is Mode.GROUND)
    assert not flight.wait(2.0).armed
    assert landed.p[2] < 0.15
    assert not fake.armed
    assert not fake.fell


@both
def test_when_its_process_is_killed_it_lands_by_itself(make: Make) -> None:
    fake = FakeAutopilot(make, START)
    flight = Flight(fake)
    flight.climb()
    flight.go((2.0, 0.0), 3.0)
    x = fake.motion.p[0]
    fake.advance(15.0)
    assert not fake.armed
    assert fake.landed
    assert not fake.fell
    assert abs(fake.motion.p[0] - x) < 0.7


@both
def test_when_its_link_is_dead_it_lands_too_and_its_position_grows_old(make: Make) -> None:
    fake = FakeAutopilot(make, START)
    flight = Flight(fake)
    flight.climb()
    fake.dead_link = True
    assert flight.wait(1.0).age_s > 0.9
    flight.wait(15.0)
    assert fake.landed
    assert not fake.fell


@both
def test_a_policy_that_hangs_is_a_hold_and_then_a_landing(make: Make) -> None:
    """The process looks at its vehicle but tells it nothing more."""
    fake = FakeAutopilot(make, START)
    flight = Flight(fake)
    flight.climb()
    flight.go((1.0, 0.0), 2.0)
    assert flight.wait(0.12).mode is Mode.FOLLOW
    assert flight.wait(0.1).mode is Mode.HOLD
    assert flight.wait(0.7).mode is Mode.HOLD
    assert flight.wait(0.2).mode is Mode.LAND
    flight.until(lambda state: state.mode is Mode.GROUND)
    assert not fake.fell


@both
def test_kill_cuts_the_motors_in_flight(make: Make) -> None:
    fake = FakeAutopilot(make, START)
    flight = Flight(fake)
    flight.climb()
    flight.vehicle.kill()
    state = flight.wait(1.5)
    assert state.mode is Mode.DEAD
    assert not state.armed
    assert fake.fell
    flight.vehicle.arm()
    assert not flight.wait(3.0).armed


@both
def test_one_that_a_pilot_takes_is_not_led_any_more(make: Make) -> None:
    fake = FakeAutopilot(make, START)
    flight = Flight(fake)
    flight.climb()
    flight.wait(1.0)
    fake.custom_mode = make.wait
    flight.go((1.0, 0.0), 1.0)
    told = fake.targets
    flight.go((1.0, 0.0), 1.0)
    flight.vehicle.land()
    state = flight.wait(3.0)
    assert state.health == (f"a pilot or its own failsafe leads it (custom mode {make.wait})",)
    assert state.mode is Mode.LAND
    assert fake.targets == told
    assert fake.custom_mode == make.wait


def test_px4_is_armed_only_after_setpoints_have_come_for_a_second() -> None:
    fake = FakeAutopilot(Make.PX4, START)
    flight = Flight(fake)
    flight.vehicle.open(3.0)
    flight.vehicle.arm()
    flight.wait(1.0)
    assert not fake.armed
    assert fake.targets >= 48
    flight.until(lambda state: state.armed, 2.0)
    assert fake.custom_mode == Make.PX4.led
    flight.wait(2.0)
    assert fake.motion.p[2] == 0.0


@both
def test_one_that_is_armed_stays_on_the_ground_and_then_takes_off(make: Make) -> None:
    """As PX4's firmware showed: told to be where it stood it spun up, was in the air for itself, and was never told to climb."""
    fake = FakeAutopilot(make, START)
    flight = Flight(fake)
    flight.arm()
    assert flight.wait(8.0).armed
    assert fake.motion.p[2] == 0.0
    flight.vehicle.take_off(HEIGHT)
    flight.until(lambda state: state.mode is Mode.HOLD)


@both
def test_one_that_disarms_itself_is_not_armed_again_unasked(make: Make) -> None:
    """Autopilots do, ten seconds after they were armed; and then somebody may go near."""
    fake = FakeAutopilot(make, START)
    flight = Flight(fake)
    flight.arm()
    flight.until(lambda state: not state.armed)
    for _ in range(20):
        assert not flight.wait(0.5).armed
        assert not fake.armed
    flight.vehicle.land()
    flight.wait(1.0)
    flight.climb()


@both
def test_one_that_does_not_take_off_is_disarmed_again(make: Make) -> None:
    fake = FakeAutopilot(make, START)
    flight = Flight(fake)
    flight.arm()
    flight.vehicle.land()
    assert not flight.wait(2.0).armed
    assert not fake.armed


def test_the_room_and_north_east_down() -> None:
    """East of the room is y of NED; a vehicle that looks east has yaw 0 in the room and 90 degrees there."""
    fake = FakeAutopilot(Make.ARDUPILOT, START)
    flight = Flight(fake)
    flight.climb()
    flight.pass_by(0.02)
    asked = []
    fake._on_set_position_target_local_ned = lambda message: asked.append(message) or []  # type: ignore[method-assign, func-returns-value]
    flight.vehicle.fly(Setpoint((1.0, 2.0, 3.0), (0.1, 0.2, 0.3), (0.4, 0.5, 0.6), yaw=0.0))
    (message,) = asked
    assert (message.x, message.y, message.z) == pytest.approx((2.0, 1.0, -3.0))
    assert (message.vx, message.vy, message.vz) == pytest.approx((0.2, 0.1, -0.3))
    assert (message.afx, message.afy, message.afz) == pytest.approx((0.5, 0.4, -0.6))
    assert message.yaw == pytest.approx(math.pi / 2)
    assert message.type_mask == 0b1000_0000_0000
    assert message.coordinate_frame == mavlink.MAV_FRAME_LOCAL_NED


def test_one_that_is_told_where_it_is_and_is_not_any_more_says_so() -> None:
    fake = FakeAutopilot(Make.PX4, START)
    fake.needs_position = True
    flight = Flight(fake)
    with pytest.raises(
        VehicleError, match=r"system 1 says no local position \(does it know where it is\?\) within 1 s"
    ):
        flight.vehicle.open(1.0)


def test_the_autopilot_that_was_asked_for_is_the_one_that_is_led() -> None:
    flight = Flight(FakeAutopilot(Make.PX4, START), f"{WHERE}?autopilot=ardupilot")
    with pytest.raises(VehicleError, match=r"the autopilot there is px4: write \?autopilot=px4, or nothing"):
        flight.vehicle.open(1.0)
    other = Flight(FakeAutopilot(Make.PX4, START, system=2), f"{WHERE}?system=3")
    with pytest.raises(VehicleError, match="no PX4 or ArduPilot is heard"):
        other.vehicle.open(1.0)
    Flight(FakeAutopilot(Make.PX4, START, system=2), f"{WHERE}?autopilot=px4&system=2").vehicle.open(1.0)


def heartbeat(system: int, kind: int, autopilot: int) -> bytes:
    sender = mavlink.MAVLink(None, srcSystem=system, srcComponent=1 if autopilot != 8 else 190)
    packed: bytes = mavlink.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 3, 3).pack(sender)
    return packed


@both
def test_where_several_autopilots_are_heard_somebody_has_to_say_which_is_led(make: Make) -> None:
    """By a mesh of radios, say."""
    for where, ills in ((WHERE, 1), (f"{WHERE}?system=1", 0)):
        flight = Flight(FakeAutopilot(make, START), where)
        flight.vehicle.open(3.0)
        flight.wire.hear([heartbeat(3, mavlink.MAV_TYPE_QUADROTOR, make.number)])
        health = flight.wait(0.1).health
        assert len(health) == ills
        assert all(ill.startswith("autopilots 1, 3 are heard: say which it is") for ill in health)


def test_a_ground_station_that_ardupilots_failsafe_would_take_for_this_computer_is_told() -> None:
    """As QGroundControl and Mission Planner are by default."""
    for make, number, ills in ((Make.ARDUPILOT, 255, 1), (Make.ARDUPILOT, 254, 0), (Make.PX4, 255, 0)):
        flight = Flight(FakeAutopilot(make, START))
        flight.vehicle.open(3.0)
        flight.wire.hear([heartbeat(number, mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID)])
        health = flight.wait(0.1).health
        assert len(health) == ills
        assert all(ill.startswith("a ground station has the number 255 too") for ill in health)
        assert flight.wait(6.0).health == ()


@given(st.lists(st.floats(width=32), min_size=6, max_size=6), st.integers(-128, 127))
def test_whatever_it_says_can_be_borne(numbers: list[float], percent: int) -> None:
    heard = Telemetry(0, None, START)
    sender = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    reader = mavlink.MAVLink(None)
    for message in (
        mavlink.MAVLink_heartbeat_message(2, 12, 0, 7, 0, 3),
        mavlink.MAVLink_attitude_message(1, *numbers),
        mavlink.MAVLink_local_position_ned_message(1, *numbers),
        mavlink.MAVLink_param_value_message(b"COM_OF_LOSS_T", numbers[0], 6, 1, 0),
        mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 0, 0, percent, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_statustext_message(3, b"\xff\n\0"),
    ):
        for read in reader.parse_buffer(message.pack(sender)):
            heard.take(read, 0.0)
    assert heard.profile is not None
    assert all(map(math.isfinite, (*heard.p, *heard.v, heard.yaw, heard.tilt)))


@both
def test_it_flies_over_udp_in_real_time(make: Make) -> None:
    fake, port = FakeAutopilot(make, START), free_ports(1)[0]
    patient = Rig(
        0, START, 2.0, 3.0, failsafe=Failsafe(3.0, 30.0)
    )  # this process may have to wait for its turn
    vehicle = make_vehicle(f"mavlink:udpin:127.0.0.1:{port}?autopilot={make.name.lower()}", patient)

    def until(so: Callable[[State], bool]) -> State:
        deadline = time.monotonic() + 20.0
        while not so(state := vehicle.state()):
            assert time.monotonic() < deadline, state
            time.sleep(0.01)
        return state

    with Wires([fake], towards=[port]):
        vehicle.open(5.0)
        vehicle.arm()
        until(lambda state: state.armed)
        vehicle.take_off(0.5)
        until(lambda state: state.mode is Mode.HOLD)
        vehicle.land()
        until(lambda state: state.mode is Mode.GROUND)
        vehicle.close()
    assert not fake.fell
