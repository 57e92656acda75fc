"""The real firmware of an autopilot, simulated: where an operator names a command that starts it (RSC_ARDUCOPTER, RSC_PX4)."""

import os
import shlex
import subprocess
import time
from collections.abc import Callable

import pytest

pytest.importorskip("pymavlink", reason="the extra 'mavlink' is not installed")

from agent.air.vehicle import Mode, Rig, State, VehicleError, make_vehicle

CONNECTIONS = {"RSC_ARDUCOPTER": "tcp:127.0.0.1:5760", "RSC_PX4": "udpin:127.0.0.1:14540"}


@pytest.mark.parametrize("name", CONNECTIONS)
def test_it_takes_off_and_lands(name: str) -> None:
    """Its parameters are left as they are: preflight would not let all of them pass."""
    if name not in os.environ:
        pytest.skip(f"{name} names no command that starts one")
    with subprocess.Popen(shlex.split(os.environ[name])) as firmware:
        try:
            vehicle = make_vehicle(f"mavlink:{CONNECTIONS[name]}", Rig(0, (0.0, 0.0, 0.0), 2.0, 3.0))
            deadline = time.monotonic() + 120.0
            while True:
                try:
                    vehicle.open(5.0)
                    break
                except VehicleError:
                    assert time.monotonic() < deadline

            def until(so: Callable[[State], bool], seconds: float = 60.0) -> None:
                deadline = time.monotonic() + seconds
                while not so(state := vehicle.state()):
                    assert time.monotonic() < deadline, state
                    time.sleep(0.01)

            vehicle.arm()
            until(lambda state: state.armed)
            vehicle.take_off(2.0)
            until(lambda state: state.mode is Mode.HOLD)
            vehicle.land()
            until(lambda state: state.mode is Mode.GROUND)
            vehicle.close()
        finally:
            firmware.kill()
