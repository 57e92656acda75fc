"""What goes wrong with an autopilot is known, and done something about, within the times that docs/hardware.md tells."""

import math

import pytest

pytest.importorskip("pymavlink", reason="the extra 'mavlink' is not installed")

from tests.agent.air.autopilot_faults import STORIES, Told
from tests.fakes.autopilot import Make

_NEVER = math.inf
#: At the latest; PX4 and ArduPilot.
WITHIN = {
    "its drone's process is killed": (Told(_NEVER, 1.6, 0.5, 8.0), Told(_NEVER, 1.2, 3.0, 13.0)),
    "its drone hangs": (Told(0.17, 1.2, 1.02, 8.0),) * 2,
    "its link is dead": (Told(0.17, 1.6, 0.5, 8.0), Told(0.17, 1.2, 3.0, 13.0)),
    "a pilot takes it": (Told(0.22, 10.0, _NEVER, _NEVER),) * 2,
    "`land` is ordered": (Told(0.02, 1.2, 0.02, 7.0),) * 2,
    "`kill` is ordered": (Told(0.02, 0.7, _NEVER, 0.7),) * 2,
}


@pytest.mark.parametrize("make", list(Make))
@pytest.mark.parametrize("what", STORIES)
def test_a_fault_is_answered_in_time(what: str, make: Make) -> None:
    told, within = STORIES[what](make), WITHIN[what][list(Make).index(make)]
    for at, latest in zip(told[:4], within[:4], strict=True):
        assert at <= latest, told
        assert (at == _NEVER) == (latest == _NEVER), told
    assert bool(told.fell) == (what == "`kill` is ordered"), told
