"""Crazyflies fly as told, through the radio host, Zenoh and the real cflib; and what happens when one of these is gone."""

import math
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import pytest

pytest.importorskip("cflib", reason="the extra 'radio' is not installed")

from agent.air.vehicle import Mode, Rig, Setpoint, State, Vehicle, VehicleError, make_vehicle
from protocols.closing import Closing
from protocols.keeper import Limits
from protocols.wire.vehicles import host_endpoint, pack_fix
from rsc_swarm.radiohost.host import Charge, RadioHost
from rsc_swarm.radiohost.line import Line, LineError, charge, init_drivers
from tests.fakes.crazyflie import FakeCrazyflie, Stage
from tests.fakes.udp import Wires, free_ports
from tests.radiohost.hosting import free_dongle, hosting

BRISK = Limits(climb_mps=1.0, sink_mps=0.7)
PATIENT = Limits(
    hold_s=3.0, land_s=30.0, climb_mps=1.0, sink_mps=0.7
)  # this process may have to wait for its turn
HEIGHT = 0.6
DONGLE, OTHER_DONGLE, NO_DONGLE = free_dongle(), free_dongle(), 73
SOURCE = f"tcp/127.0.0.1:{free_ports(1)[0]}"


class Led(Closing):
    """A vehicle, and what it is in truth."""

    def __init__(self, drone: int, port: int, fake: FakeCrazyflie, dongle: int) -> None:
        rig = Rig(drone, fake.motion.p, 1.0, 3.0, dongle=dongle)
        self.vehicle: Vehicle = make_vehicle(f"crazyflie:udp://127.0.0.1:{port}", rig)
        self.fake = fake
        self.vehicle.open(10.0)

    def until(self, so: Callable[[State], bool], tell: Callable[[], object] = lambda: None) -> State:
        """Look at it, and tell it something, 100 times a second until what it says of itself is so."""
        deadline = time.monotonic() + 20.0
        while not so(state := self.vehicle.state()):
            assert time.monotonic() < deadline, state
            tell()
            time.sleep(0.01)
        return state

    def climb(self) -> None:
        self.vehicle.arm()
        self.until(lambda state: state.armed)
        self.vehicle.take_off(HEIGHT)
        self.until(lambda state: state.mode is Mode.HOLD)

    def go(self, way: tuple[float, float], seconds: float) -> float:
        """Lead it along a straight line; how far it was from where it was to be, at worst [m]."""
        (x, y, _), worst, steps = self.fake.motion.p, 0.0, round(100 * seconds)
        for step in range(steps):  # on a busy machine it takes longer
            part = step / steps
            p = x + part * way[0], y + part * way[1], HEIGHT
            self.vehicle.fly(Setpoint(p, (way[0] / seconds, way[1] / seconds, 0.0), (0.0, 0.0, 0.0)))
            self.vehicle.state()
            worst = max(worst, math.dist(p, self.fake.motion.p))
            time.sleep(0.01)
        return worst

    def close(self) -> None:
        self.vehicle.close()


class Room(NamedTuple):
    """Vehicles behind one radio host."""

    host: RadioHost
    square: Led
    silent: Led
    dead: Led
    told: Led
    back: Led


@pytest.fixture(scope="module")
def room() -> Iterator[Room]:
    fakes = [FakeCrazyflie((0.0, 2.0 * drone, 0.0), arms_itself=drone % 2 == 0) for drone in range(5)]
    fakes[3].needs_position = True
    with Wires(fakes) as wires:
        limits = [PATIENT, BRISK, PATIENT, PATIENT, PATIENT]
        charges = [
            Charge(drone, f"udp://127.0.0.1:{port}", limits[drone]) for drone, port in enumerate(wires.ports)
        ]
        charges[3] = replace(charges[3], position_key="mocap/cf3")
        with RadioHost("rsc", host_endpoint(DONGLE), charges, positions=SOURCE) as host:
            host.open()
            over = threading.Event()
            thread = threading.Thread(target=host.run, args=[over.is_set])
            thread.start()
            led = [Led(drone, wires.ports[drone], fake, DONGLE) for drone, fake in enumerate(fakes)]
            yield Room(host, *led)
            for one in led:
                one.close()
            over.set()
            thread.join()


def test_it_flies_a_square_holds_and_lands(room: Room) -> None:
    square = room.square
    assert square.vehicle.state().health == ()
    assert square.fake.controller == 2
    square.climb()
    worst = [square.go(way, 1.0) for way in ((0.5, 0.0), (0.0, 0.5), (-0.5, 0.0), (0.0, -0.5))]
    assert max(worst) < 0.5  # corners, and late ticks of a busy machine
    square.vehicle.hold()
    held = square.until(lambda state: state.mode is Mode.HOLD and math.hypot(*state.v) < 0.02)
    assert math.dist(held.p, square.fake.motion.p) < 0.05
    assert math.dist(held.p, (0.0, 0.0, HEIGHT)) < 0.3
    assert held.battery > 0.7  # its firmware calls it 10 %
    square.vehicle.land()
    landed = square.until(lambda state: state.mode is Mode.GROUND)
    assert not landed.armed
    square.until(lambda _: not square.fake.motors_on)
    assert not square.fake.motion.fell
    assert square.fake.setpoints > 50


@pytest.mark.parametrize(
    ("volts", "flying", "share"),
    [
        (4.2, False, 1.0),
        (3.9, False, 0.5),
        (3.6, False, 0.0),
        (4.0, True, 1.0),
        (3.69, True, 0.69),
        (3.2, True, 0.2),
        (2.9, True, 0.0),
    ],
)
def test_a_battery_is_judged_by_what_its_motors_pull(volts: float, flying: bool, share: float) -> None:
    """3.69 V is what Bitcraze measured at the thrust of hovering, of one with 4.01 V at rest; its firmware calls 3.2 V low."""
    assert charge(volts, flying) == pytest.approx(share)


def test_one_that_cannot_be_armed_says_so_before(room: Room) -> None:
    one = room.silent
    for what, words in (
        ("faulty", "it cannot be armed: its console in cfclient says why"),
        ("crashed", "locked after a failsafe or a crash: switch it off and on"),
    ):
        setattr(one.fake, what, True)
        one.until(lambda state, words=words: state.health == (words,))  # type: ignore[misc]
        setattr(one.fake, what, False)
        one.until(lambda state: state.health == ())


def test_one_whose_process_is_gone_lands(room: Room) -> None:
    """The process is gone: its session is closed, nothing is said any more."""
    silent = room.silent
    silent.climb()
    silent.go((0.5, 0.0), 1.0)
    silent.close()
    deadline = time.monotonic() + 10.0
    while silent.fake.stage is not Stage.UNARMED and time.monotonic() < deadline:
        time.sleep(0.05)
    assert silent.fake.stage is Stage.UNARMED
    assert not silent.fake.motion.fell
    assert 0.3 < silent.fake.motion.p[0] < 1.0


def test_one_whose_link_is_dead_levels_and_falls_as_the_firmware_has_it(room: Room) -> None:
    """Nobody can reach it. Its drone knows: the position grows old at once."""
    dead = room.dead
    dead.climb()
    dead.fake.dead_link = True
    told = dead.until(lambda state: state.age_s > 0.5)
    assert told.health == ("nothing comes from the vehicle",)
    dead.until(lambda _: dead.fake.stage is Stage.LOCKED)
    dead.fake.dead_link = False
    told = dead.until(lambda state: state.mode is Mode.DEAD)
    assert "locked after a failsafe or a crash: switch it off and on" in told.health


def test_a_link_that_cflib_gives_up_is_made_anew(room: Room) -> None:
    """The dongle was out for a moment: cflib closes the link and forgets it, and one of its threads was just sending."""
    back = room.back
    back.climb()
    back.go((0.5, 0.0), 1.0)
    line = room.host._cares[4].line
    line._cf._send_lock.acquire()
    line._cf._link_error_cb("the dongle has been unplugged")
    before = back.fake.setpoints
    back.go((0.5, 0.0), 2.0)
    assert back.fake.setpoints > before + 20
    assert back.vehicle.state().health == ()
    back.vehicle.land()
    back.until(lambda state: state.mode is Mode.GROUND)
    assert not back.fake.motion.fell


def test_one_that_is_told_where_it_is_says_when_it_is_told_no_more(room: Room) -> None:
    import zenoh

    told = room.told
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{host_endpoint(DONGLE)}"]')
    told.until(lambda state: state.health == ("it is not sure of its position",) and state.age_s > 0.5)
    with zenoh.open(config) as tracker:
        told.until(
            lambda state: state.health == () and math.dist(state.p, (1.0, 2.0, 0.5)) < 0.01,
            lambda: tracker.put("rsc/body/3/position", pack_fix((1.0, 2.0, 0.5))),
        )
        assert told.vehicle.state().age_s < 1.0
        told.until(lambda state: 0.5 < state.age_s < 10.0 and len(state.health) == 1)


def test_one_is_told_where_it_is_by_the_source_that_the_fleet_file_names(room: Room) -> None:
    """The bridge is started after the radio host, says rubbish, and speaks of others, too."""
    import zenoh

    told, config = room.told, zenoh.Config()
    config.insert_json5("listen/endpoints", f'["{SOURCE}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config) as bridge:

        def tell() -> None:
            bridge.put("mocap/cf3", b"rubbish")
            bridge.put("mocap/cf4", pack_fix((9.0, 9.0, 9.0)))
            bridge.put("mocap/cf3", pack_fix((1.5, 2.0, 0.5)))

        told.until(lambda state: state.health == () and math.dist(state.p, (1.5, 2.0, 0.5)) < 0.01, tell)


def test_when_the_radio_host_is_killed_its_warden_lands_who_flies() -> None:
    fake = FakeCrazyflie()
    with Wires([fake]) as wires:
        patient = hosting(wires.ports[0], OTHER_DONGLE, hold_s=3.0, land_s=30.0, climb_mps=1.0, sink_mps=0.7)
        with patient as host, Led(0, wires.ports[0], fake, OTHER_DONGLE) as led:
            led.climb()
            led.go((0.5, 0.0), 1.0)
            time.sleep(0.1)
            host.kill()
            deadline = time.monotonic() + 10.0
            while fake.motors_on and time.monotonic() < deadline:
                time.sleep(0.05)
    assert not fake.motors_on
    assert not fake.motion.fell
    assert fake.stage in (Stage.FLYING, Stage.READY)


def test_the_host_of_another_fleet_leads_no_crazyflie_of_this_one(room: Room) -> None:
    """Two fleets on one machine, the second of whose hosts found its port taken: drone 0 of both has the same number."""
    stranger = make_vehicle("crazyflie:udp://127.0.0.1:9", Rig(0, (0.0, 0.0, 0.0), 1.0, 3.0, dongle=DONGLE))
    with pytest.raises(
        VehicleError,
        match=r"says nothing of the Crazyflie of drone 0 at udp://127\.0\.0\.1:9: it does not reach",
    ):
        stranger.open(1.0)


def test_without_a_radio_host_there_is_no_vehicle() -> None:
    vehicle = make_vehicle("crazyflie:radio://0/80/2M/E7E7E7E701", Rig(0, (0, 0, 0), 1, 3, dongle=NO_DONGLE))
    with pytest.raises(
        VehicleError, match=r"no radio host answers at tcp/127\.0\.0\.1:7543 within 0\.3 s: start it"
    ):
        vehicle.open(0.3)


def test_a_crazyflie_that_is_not_there_is_given_up_in_time() -> None:
    init_drivers()
    fake = FakeCrazyflie()
    fake.dead_link = True
    with Wires([fake]) as wires:
        line = Line(f"udp://127.0.0.1:{wires.ports[0]}", lambda: None)
        with pytest.raises(
            LineError, match=r"nothing answers at udp://127\.0\.0\.1:\d+ within 0\.5 s: is it switched on"
        ):
            line.open(0.5)


def test_a_dongle_that_is_not_there_is_told_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """No minute is waited for it, as for a Crazyflie that somebody may yet switch on."""
    monkeypatch.setattr("rsc_swarm.radiohost.line._TAKES_S", 0.1)
    init_drivers()
    with pytest.raises(
        LineError, match=r"radio://99/80/2M cannot be used: Cannot find a Crazyradio Dongle; is the dongle in"
    ):
        Line("radio://99/80/2M", lambda: None).open(30.0)
