"""The real firmware of an autopilot, simulated: where an operator names a command that starts it (RSC_ARDUCOPTER, RSC_PX4)."""

import math
import os
from contextlib import AbstractContextManager

import pytest

pytest.importorskip("pymavlink", reason="the extra 'mavlink' is not installed")

from agent.air.vehicle import Mode
from tests.firmware.flown import STORIES, Flown, Told, flying, story

NAMES = {"RSC_ARDUCOPTER": "ardupilot", "RSC_PX4": "px4"}
_NEVER = math.inf
#: At the latest, as its own clock and a busy machine have it.
WITHIN = {
    "its drone's process is killed": Told(3.0, 3.5, 20.0),
    "its drone hangs": Told(3.0, 1.5, 15.0),
    "a pilot takes it": Told(
        5.0, _NEVER, _NEVER
    ),  # its own doing: BRAKE of ArduCopter 4.1 s, POSITION of PX4 1.1 s
    "`land` is ordered": Told(3.0, 1.0, 15.0),
    "`kill` is ordered": Told(_NEVER, _NEVER, 1.0),
}


def flown(variable: str) -> AbstractContextManager[Flown]:
    if variable not in os.environ:
        pytest.skip(f"{variable} names no command that starts one")
    return flying(NAMES[variable], os.environ[variable])


@pytest.mark.parametrize("variable", NAMES)
def test_it_takes_off_flies_a_circle_and_lands(variable: str) -> None:
    """Its parameters are left as they are: preflight would not let all of them pass."""
    with flown(variable) as one:
        one.climb()
        assert one.circle(15.0) < 0.4
        one.vehicle.land()
        one.until(lambda state: state.mode is Mode.GROUND)


@pytest.mark.parametrize("what", STORIES)
@pytest.mark.parametrize("variable", NAMES)
def test_what_goes_wrong_is_answered(variable: str, what: str) -> None:
    """Its parameters have to be those that preflight wants."""
    with flown(variable) as one:
        (_, told), within = story(one, what), WITHIN[what]
    for at, latest in zip(told[:3], within[:3], strict=True):
        assert at <= latest, told
    assert (told.down == _NEVER) == (within.down == _NEVER), told
