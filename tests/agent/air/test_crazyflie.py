"""What is wrong with the address of a Crazyflie is said before anything is opened, and what it is told when. Flights:
tests/radiohost."""

import signal
import time
from types import FrameType, SimpleNamespace

import pytest

from agent.air import crazyflie
from agent.air.crazyflie import CrazyflieVehicle
from agent.air.vehicle import Rig, Setpoint, VehicleAddressError, make_vehicle
from protocols.wire.vehicles import Account, Ill, Kind, Mode, unpack_order

_STILL = (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("where", "options", "why"),
    [
        ("", {}, "'' is no address of a Crazyflie"),
        ("radio://0/80/2M/nothex", {}, "is no address of a Crazyflie"),
        ("radio://0/80/2M", {"hots": "x"}, "has no option 'hots': its only option is host"),
        ("radio://0/80/2M", {"host": "127.0.0.1:7470"}, "'127.0.0.1:7470' is not an endpoint"),
    ],
)
def test_an_address_that_is_none_is_refused(where: str, options: dict[str, str], why: str) -> None:
    with pytest.raises(VehicleAddressError, match=why) as error:
        make_vehicle(f"crazyflie:{where}", Rig(0, (0.0, 0.0, 0.0), 1.0, 3.0, options=options))
    assert "\n" not in str(error.value)


def test_who_looks_for_a_radio_host_can_be_asked_to_leave() -> None:
    """It heard no signal for a minute."""

    def asked(_: int, __: FrameType | None) -> None:
        raise KeyboardInterrupt

    vehicle = CrazyflieVehicle("udp://127.0.0.1:19850", Rig(0, _STILL, 1.0, 3.0, dongle=99))
    before = signal.signal(signal.SIGALRM, asked)
    began = time.monotonic()
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        with pytest.raises(KeyboardInterrupt):
            vehicle.open(30.0)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert time.monotonic() - began < 15.0


def test_a_setpoint_takes_the_place_of_an_order_that_is_said_again(monkeypatch: pytest.MonkeyPatch) -> None:
    now, said = [0.0], []
    monkeypatch.setattr(crazyflie, "time", SimpleNamespace(monotonic=lambda: now[0]))
    vehicle = CrazyflieVehicle("udp://127.0.0.1:19850", Rig(0, _STILL, 1.0, 3.0, dongle=0))
    vehicle._publisher = SimpleNamespace(put=lambda data: said.append(unpack_order(data).kind))  # type: ignore[assignment]
    vehicle._newest = (0.0, Account(Mode.HOLD, 1, True, Ill(0), _STILL, _STILL, 0.0, 0.0, 0.0, 1.0))
    vehicle.take_off(0.8)
    for tick in range(
        1, 21
    ):  # as exactly as no clock: each look at the state comes before the setpoint of its tick
        now[0] = tick / 100
        vehicle.state()
        if tick > 10:
            vehicle.fly(Setpoint(_STILL, _STILL, _STILL, 0.0))
    assert said == [Kind.TAKE_OFF] * 6 + [Kind.FLY] * 5
