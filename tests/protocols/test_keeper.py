"""The keeper keeps a Crazyflie in the air when its drone's process hangs or dies: flown against the fake, in simulated time."""

import math

import pytest

from protocols.keeper import Act, Arm, Cut, Keeper, Land, Limits, Seen, Stream, TakeOff
from protocols.wire.vehicles import Kind, Mode, Order, Vector
from tests.fakes.crazyflie import FakeCrazyflie, Stage
from tests.fakes.packets import ARM, DISARM, EMERGENCY_STOP, NOTIFY_STOP, land, setpoint, take_off

HEIGHT = 1.0


class Flight:
    """A keeper and its Crazyflie; a drone that says its order 50 times a second until it falls silent."""

    def __init__(self, arms_itself: bool = True) -> None:
        self.fake, self.keeper, self.now = FakeCrazyflie(arms_itself=arms_itself), Keeper(Limits()), 100.0
        self.order: Order | None = None
        self.setpoints: list[float] = []  # when each was sent

    def say(self, kind: Kind, p: Vector = (0.0, 0.0, HEIGHT)) -> None:
        self.order = Order(kind, self.order.number + 1 if self.order else 1, p)

    def wait(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.02)):
            if self.order:
                self.keeper.hear(self.order, self.now)
            for act in self.keeper.act(self.seen(), self.now):
                for packet in self.packets(act):
                    self.fake.take(packet)
            self.fake.advance(0.02)
            self.now += 0.02

    def fly(self, seconds: float, speed: float = 0.5) -> None:
        x, y, _ = self.fake.motion.p
        for step in range(round(seconds / 0.02)):
            number = self.order.number + 1 if self.order else 1
            self.order = Order(Kind.FLY, number, (x + speed * 0.02 * step, y, HEIGHT), (speed, 0.0, 0.0))
            self.wait(0.02)

    def climb(self) -> None:
        self.say(Kind.ARM)
        self.wait(0.1)
        self.say(Kind.TAKE_OFF)
        self.wait(3.0)
        assert self.keeper.mode is Mode.HOLD

    def fall_silent(self) -> None:
        self.order = None

    def seen(self) -> Seen:
        motion, stage = self.fake.motion, self.fake.stage
        armed, flying = stage not in (Stage.UNARMED, Stage.LOCKED), stage in (Stage.FLYING, Stage.LEVELLING)
        arms_itself = bool(self.fake.bits() & 4)
        locked = stage is Stage.LOCKED
        return Seen(self.now, motion.p, motion.v, 0.0, 0.0, 1.0, armed, arms_itself, flying, locked)

    def packets(self, act: Act) -> list[bytes]:
        """As rsc_swarm.radiohost.line says it."""
        match act:
            case Stream(p, v, a, _):
                self.setpoints.append(self.now)
                return [setpoint(p, v, a)]
            case TakeOff(height, duration_s):
                return [take_off(height, duration_s)]
            case Land(duration_s):
                return [land(duration_s), NOTIFY_STOP, land(duration_s)]
            case Arm(on):
                return [ARM if on else DISARM]
            case Cut():
                return [EMERGENCY_STOP]


@pytest.mark.parametrize("arms_itself", [True, False])
def test_it_flies_as_told_from_the_ground_to_the_ground(arms_itself: bool) -> None:
    flight = Flight(arms_itself)
    flight.wait(0.5)
    assert not flight.keeper.armed
    flight.climb()
    assert math.dist(flight.fake.motion.p, (0.0, 0.0, HEIGHT)) < 0.05
    flight.fly(4.0)
    assert flight.keeper.mode is Mode.FOLLOW
    assert math.dist(flight.fake.motion.p, (2.0, 0.0, HEIGHT)) < 0.05
    flight.say(Kind.HOLD)
    flight.wait(1.0)
    assert flight.keeper.mode is Mode.HOLD
    assert math.hypot(*flight.fake.motion.v) < 0.02
    flight.say(Kind.LAND)
    flight.wait(6.0)
    assert flight.keeper.mode is Mode.GROUND
    assert not flight.keeper.armed
    assert not flight.fake.motors_on
    assert not flight.fake.motion.fell


def test_setpoints_reach_it_50_times_a_second() -> None:
    flight = Flight()
    flight.climb()
    flight.setpoints.clear()
    flight.fly(2.0)
    assert len(flight.setpoints) == 100


def test_an_order_that_was_overtaken_on_its_way_is_dropped() -> None:
    flight = Flight()
    flight.climb()
    flight.fly(1.0)
    overtaken = flight.order
    assert overtaken is not None
    flight.say(Kind.HOLD)
    flight.wait(0.1)
    flight.keeper.hear(overtaken, flight.now)
    flight.keeper.act(flight.seen(), flight.now)
    assert flight.keeper.mode is Mode.HOLD


def test_one_that_hangs_is_a_hold_after_150_ms_and_a_landing_after_1_s() -> None:
    flight = Flight()
    flight.climb()
    flight.fly(2.0)
    flight.fall_silent()
    flight.wait(0.14)
    assert flight.keeper.mode is Mode.FOLLOW
    flight.wait(0.06)
    assert flight.keeper.mode is Mode.HOLD
    flight.wait(0.78)
    assert flight.keeper.mode is Mode.HOLD
    assert math.hypot(*flight.fake.motion.v) < 0.05
    flight.wait(0.06)
    assert flight.keeper.mode is Mode.LAND
    flight.wait(6.0)
    assert flight.keeper.mode is Mode.GROUND
    assert not flight.fake.motion.fell


def test_one_that_comes_back_in_time_flies_on() -> None:
    flight = Flight()
    flight.climb()
    flight.fly(1.0)
    order = flight.order
    flight.fall_silent()
    flight.wait(0.5)
    assert flight.keeper.mode is Mode.HOLD
    flight.order = order
    flight.fly(1.0)
    assert flight.keeper.mode is Mode.FOLLOW


@pytest.mark.parametrize("seconds", [0.5, 3.0], ids=["climbing", "holding"])
def test_silence_before_the_first_setpoint_is_a_landing_too(seconds: float) -> None:
    flight = Flight()
    flight.say(Kind.ARM)
    flight.wait(0.1)
    flight.say(Kind.TAKE_OFF)
    flight.wait(seconds)
    flight.fall_silent()
    flight.wait(8.0)
    assert flight.keeper.mode is Mode.GROUND
    assert flight.fake.motion.p[2] == 0.0
    assert not flight.fake.motion.fell


def test_no_order_but_the_last_stops_a_landing() -> None:
    flight = Flight()
    flight.climb()
    flight.say(Kind.LAND)
    flight.wait(0.5)
    flight.fly(0.5)
    flight.say(Kind.HOLD)
    flight.wait(0.2)
    assert flight.keeper.mode is Mode.LAND
    flight.say(Kind.KILL)
    flight.wait(1.0)
    assert flight.keeper.mode is Mode.DEAD
    assert flight.fake.motion.fell


def test_an_old_take_off_does_not_lift_it_again() -> None:
    """A process that was stopped while it held, and goes on after its vehicle has landed, says its order again."""
    flight = Flight()
    flight.climb()
    order = flight.order
    flight.fall_silent()
    flight.wait(8.0)
    assert flight.keeper.mode is Mode.GROUND
    flight.order = order
    flight.wait(2.0)
    assert flight.keeper.mode is Mode.GROUND
    assert flight.fake.motion.p[2] == 0.0


def test_a_process_that_was_started_anew_is_obeyed() -> None:
    flight = Flight()
    flight.climb()
    flight.fly(4.0)
    flight.fall_silent()
    flight.wait(8.0)
    flight.order = None
    flight.climb()


def test_it_does_not_take_off_unarmed() -> None:
    flight = Flight()
    flight.say(Kind.TAKE_OFF)
    flight.wait(2.0)
    assert flight.keeper.mode is Mode.GROUND
    assert flight.fake.motion.p[2] == 0.0


def test_what_is_lost_on_the_way_is_said_again() -> None:
    flight = Flight(arms_itself=False)
    flight.fake.dead_link = True
    flight.say(Kind.ARM)
    flight.wait(0.1)
    flight.fake.dead_link = False
    flight.wait(0.4)
    flight.fake.dead_link = True
    flight.say(Kind.TAKE_OFF)
    flight.wait(0.1)
    flight.fake.dead_link = False
    flight.wait(3.0)
    assert flight.fake.motion.p[2] > 0.9
    flight.fake.dead_link = True
    flight.say(Kind.LAND)
    flight.wait(0.1)
    flight.fake.dead_link = False
    flight.wait(6.0)
    assert flight.keeper.mode is Mode.GROUND
    assert not flight.fake.motion.fell


def test_one_whose_failsafe_has_cut_the_motors_is_dead() -> None:
    flight = Flight()
    flight.climb()
    flight.fake.dead_link = True
    flight.wait(3.0)
    flight.fake.dead_link = False
    flight.wait(0.1)
    assert flight.keeper.mode is Mode.DEAD


def test_one_that_is_found_in_the_air_is_left_alone() -> None:
    """A radio host that was started anew while the old one's warden lands its vehicles."""
    flight = Flight(arms_itself=False)
    flight.climb()
    flight.fake.take(land(2.0))
    flight.fake.take(NOTIFY_STOP)
    flight.keeper = Keeper(Limits())
    flight.say(Kind.ARM)
    flight.wait(0.5)
    flight.say(Kind.TAKE_OFF)
    flight.wait(0.5)
    assert flight.keeper.mode is Mode.GROUND
    flight.fall_silent()
    flight.wait(5.0)
    assert not flight.fake.motion.fell


def test_one_that_somebody_else_disarms_is_dead() -> None:
    flight = Flight(arms_itself=False)
    flight.climb()
    flight.fake.take(DISARM)
    flight.wait(1.0)
    assert flight.keeper.mode is Mode.DEAD
