"""What is wrong with the address of a Crazyflie is said before anything is opened. Flights: tests/radiohost."""

import pytest

from agent.air.vehicle import Rig, VehicleAddressError, make_vehicle


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
