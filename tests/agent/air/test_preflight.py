"""What speaks against arming a drone."""

from typing import Any

import pytest

from agent.air.preflight import complaints
from agent.air.vehicle import Mode, State
from tests.agent.air.hall import plan_of

PLAN = plan_of()
X, Y = PLAN.starts[1]


def said(p: tuple[float, float, float] = (X, Y, 0.0), **changes: Any) -> list[str]:
    """Of drone 1, whose state has these changes, and where nothing else speaks against it."""
    state: dict[str, Any] = {"age_s": 0.01, "battery": 1.0, "mode": Mode.GROUND, "armed": False}
    one = State(p, (0.0, 0.0, 0.0), 0.0, 0.0, **state | changes)
    return complaints(PLAN, 1, one, [0, 2, 3, 4, 5], 0.0, True, 0.0)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"p": (X + 0.4, Y, 0.0)}, "it stands 0.40 m from its start; move it to"),
        ({"p": (X, Y, 0.75)}, "it stands 0.75 m above the room's floor; start it from the floor"),
        ({"p": (X, Y, -1.2)}, "it stands 1.20 m below the room's floor"),
        ({"p": (X, Y, float("nan"))}, "it stands nan m above the room's floor"),
        ({"age_s": float("inf")}, "its position is 999.0 s old"),
        ({"battery": 0.49}, "battery at 49 %; it needs 50 %"),
        ({"mode": Mode.LAND}, "the vehicle is not on the ground (land)"),
        ({"health": ("its propeller is off",)}, "its propeller is off"),
    ],
)
def test_whatever_is_not_as_it_must_be_is_told(changes: dict[str, Any], complaint: str) -> None:
    (told,) = said(**changes)
    assert told.startswith(complaint)


def test_nothing_speaks_against_one_that_stands_where_it_should() -> None:
    assert said(p=(X, Y, 0.05)) == []
