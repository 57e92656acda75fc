"""Where an autopilot is to be found: an address is read or refused in one line, and one that is not there is given up in time."""

import os
import pty
from pathlib import Path

import pytest

pytest.importorskip("pymavlink", reason="the extra 'mavlink' is not installed")

from agent.air.mavlink import connected, parse_address
from agent.air.vehicle import Rig, VehicleAddressError, VehicleError, make_vehicle
from tests.agent.air.led import START, WHERE
from tests.fakes.udp import free_ports


def test_one_that_is_not_there_is_given_up_in_time() -> None:
    vehicle = make_vehicle(f"mavlink:udpin:127.0.0.1:{free_ports(1)[0]}", Rig(0, START, 2.0, 3.0))
    with pytest.raises(VehicleError, match=r"no PX4 or ArduPilot is heard .* within 0\.2 s"):
        vehicle.open(0.2)
    vehicle = make_vehicle("mavlink:serial:/dev/nothing-there:57600", Rig(0, START, 2.0, 3.0))
    with pytest.raises(
        VehicleError,
        match=r"mavlink:serial:/dev/nothing-there:57600 cannot be opened: there is no such device",
    ):
        vehicle.open(0.2)


def test_a_serial_line_is_one_programs(tmp_path: Path) -> None:
    """A second process of a drone in flight would take a part of what its autopilot says."""
    ours, theirs = pty.openpty()
    where = f"serial:{os.ttyname(theirs)}:57600"
    link = connected(where)
    with pytest.raises(VehicleError, match=f"mavlink:{where} cannot be opened: another program uses it"):
        connected(where)
    link.close()
    connected(where).close()
    os.close(theirs)
    os.close(ours)
    (tmp_path / "log").write_text("")
    with pytest.raises(VehicleError, match="cannot be opened: Could not configure port"):
        connected(f"serial:{tmp_path / 'log'}:57600")


@pytest.mark.parametrize(
    ("where", "options", "why"),
    [
        ("", {}, "'' is no connection: one reads udpin:127.0.0.1:14550"),
        ("udpin:127.0.0.1", {}, "'udpin:127.0.0.1' is no connection"),
        ("udpin:127.0.0.1:²", {}, "is no connection"),
        ("udpin:127.0.0.1:65536", {}, "a port is a number from 1 to 65535"),
        ("serial:/dev/ttyAMA0", {}, "is no connection"),
        (f"{WHERE}?", {}, r"behind the \? stand only"),
        (f"{WHERE}?autopilot=", {}, "autopilot= is none of px4, ardupilot"),
        (f"{WHERE}?autopilot=betaflight", {}, "autopilot=betaflight is none of px4, ardupilot"),
        (f"{WHERE}?pilot=px4", {}, r"behind the \? stand only"),
        (f"{WHERE}?system=0", {}, "system=0 is no number from 1 to 254"),
        (f"{WHERE}?system=300", {}, "system=300 is no number from 1 to 254"),
        (WHERE, {"orign": "1,2,3"}, "no option 'orign': its only option is origin"),
        (WHERE, {"origin": "47.3,8.5"}, "origin: '47.3,8.5' is not LATITUDE,LONGITUDE,ALTITUDE"),
        (WHERE, {"origin": "97.3,8.5,0"}, "is not LATITUDE,LONGITUDE,ALTITUDE"),
        (WHERE, {"origin": "nan,8.5,0"}, "is not LATITUDE,LONGITUDE,ALTITUDE"),
    ],
)
def test_an_address_that_is_none_is_refused(where: str, options: dict[str, str], why: str) -> None:
    with pytest.raises(VehicleAddressError, match=why) as error:
        make_vehicle(f"mavlink:{where}", Rig(0, START, 2.0, 3.0, options=options))
    assert "\n" not in str(error.value)


def test_an_address_is_read() -> None:
    assert parse_address("serial:/dev/ttyAMA0:921600?system=7")[::2] == ("serial:/dev/ttyAMA0:921600", 7)
