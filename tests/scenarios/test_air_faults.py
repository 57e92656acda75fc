"""Whatever goes wrong in the air: nothing hits anything, nobody falls but by `kill`, and all do in time what is documented."""

from typing import NamedTuple

import pytest

from tests.agent.air.faults import STORIES
from tests.agent.air.hall import plan_of

_LATE_S = 0.1  # the operator's word comes ten times a second
LIMIT_M = plan_of("lab-small", scale=0.25, origin_m=[-2.5, 0]).limit_m


class Expected(NamedTuple):
    """The first hold and the first landing, at most so many seconds after the fault; None: nobody does. through: drones that fly
    the mission to its end."""

    hold_s: float | None
    land_s: float | None
    through: int
    fell: int = 0


EXPECTED = {
    "killed": Expected(0.2, 1.0, 5),
    "leader killed": Expected(0.2, 1.0, 5),
    "operator": Expected(5.0, 10.0, 0),
    "lossy": Expected(None, None, 6),
    "parted": Expected(None, None, 6),
    "long parted": Expected(5.0, 15.0, 0),
    "deaf": Expected(5.0, 15.0, 5),
    "clock": Expected(2.5, 12.5, 5),
    "spoofed": Expected(None, None, 6),
    "before_all": Expected(0.6, 10.6, 5),
    "bullet": Expected(None, None, 6),
    "many": Expected(None, None, 6),
    "time_of_day": Expected(None, 2.1, 5),
    "frozen": Expected(0.15, 0.5, 5),
    "jump": Expected(0.0, 10.0, 5),
    "empty": Expected(None, 2.0, 5),
    "tilted": Expected(None, 0.0, 5),
    "gust": Expected(0.4, 1.3, 5),
    "land": Expected(None, 0.1, 0),
    "abort": Expected(0.1, 2.1, 0),
    "kill": Expected(None, None, 0, fell=6),
}


@pytest.mark.parametrize("name", STORIES)
def test_a_fault_in_the_air(name: str) -> None:
    expected, told = EXPECTED[name], STORIES[name]()
    for at, within in ((told.hold_s, expected.hold_s), (told.land_s, expected.land_s)):
        assert (at is None) == (within is None), told
        assert at is None or within is None or at <= within + _LATE_S, told
    assert told.others == expected.through, told
    assert told.fell == expected.fell, told
    assert told.closest_m >= LIMIT_M, told
    assert told.slot_error_m <= 0.15, told
