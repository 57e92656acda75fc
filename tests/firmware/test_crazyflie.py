"""The real firmware of a Crazyflie, in the loop, led by a radio host: where an operator names a binary (RSC_CF_FIRMWARE)."""

import math
import os
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("cflib", reason="the extra 'radio' is not installed")
if "RSC_CF_FIRMWARE" not in os.environ:
    pytest.skip("RSC_CF_FIRMWARE names no binary of the firmware", allow_module_level=True)

from agent.air.vehicle import Mode, Rig, State, Vehicle, make_vehicle
from tests.firmware.circle import on_circle
from tests.firmware.in_the_loop import InTheLoop, in_the_loop
from tests.radiohost.hosting import free_dongle, hosting

BINARY = Path(os.environ["RSC_CF_FIRMWARE"])
HEIGHT, RADIUS, SPEED = 0.6, 0.4, 0.45


class Flown:
    """A vehicle, its firmware, and the radio host between."""

    def __init__(self, vehicle: Vehicle, loop: InTheLoop, host: subprocess.Popen[bytes]) -> None:
        self.vehicle, self.loop, self.host = vehicle, loop, host

    def until(self, mode: Mode, seconds: float = 30.0) -> State:
        deadline = time.monotonic() + seconds
        while (state := self.vehicle.state()).mode is not mode:
            assert time.monotonic() < deadline, state
            time.sleep(0.01)
        return state

    def climb(self) -> None:
        deadline = time.monotonic() + 20.0
        self.vehicle.arm()
        while not self.vehicle.state().armed:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        self.vehicle.take_off(HEIGHT)
        self.until(Mode.HOLD)

    def circle(self, seconds: float) -> float:
        """Lead it around; how far it was from where it was to be, on average [m]."""
        (x, y, _), errors, begun = self.loop.body.p, [], time.monotonic()
        while (now := time.monotonic() - begun) < seconds:
            setpoint = on_circle(x, y, now, HEIGHT, RADIUS, SPEED)
            self.vehicle.fly(setpoint)
            self.vehicle.state()
            errors.append(math.dist(setpoint.p[:2], self.loop.body.p[:2]))
            time.sleep(0.01)
        return sum(errors) / len(errors)

    def stands(self, seconds: float = 15.0) -> bool:
        deadline = time.monotonic() + seconds
        while self.loop.body.p[2] > 0.0 and time.monotonic() < deadline:
            time.sleep(0.05)
        return self.loop.body.p[2] == 0.0


@pytest.fixture
def flown() -> Iterator[Flown]:
    dongle = free_dongle()
    with in_the_loop(BINARY, (0.5, 0.2, 0.0)) as loop, hosting(loop.port, dongle) as host:
        vehicle = make_vehicle(
            f"crazyflie:udp://127.0.0.1:{loop.port}", Rig(0, loop.body.p, 1.0, 3.0, dongle=dongle)
        )
        vehicle.open(90.0)
        yield Flown(vehicle, loop, host)
        vehicle.close()


def test_it_takes_off_flies_a_circle_and_lands(flown: Flown) -> None:
    flown.climb()
    error = flown.circle(6.0)
    print(f"mean error on a circle at {SPEED} m/s: {error:.3f} m")
    assert error < 0.15
    flown.vehicle.land()
    flown.until(Mode.GROUND)
    assert flown.stands()
    assert not flown.loop.body.fell


def test_one_whose_process_is_gone_lands(flown: Flown) -> None:
    flown.climb()
    flown.circle(2.0)
    flown.vehicle.close()
    assert flown.stands()
    assert not flown.loop.body.fell


def test_when_the_radio_host_is_killed_its_warden_lands_it(flown: Flown) -> None:
    flown.climb()
    flown.circle(2.0)
    flown.host.kill()
    assert flown.stands()
    assert not flown.loop.body.fell
