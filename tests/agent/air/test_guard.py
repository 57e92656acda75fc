"""The guard says what is wrong, how bad it is, and nothing where nothing is wrong."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent.air.guard import Action, Bounds, Mover, Situation, judge
from agent.air.vehicle import Mode, Setpoint, State
from protocols.fleet.document import Fence, Guard

BOUNDS = Bounds(
    Fence(x_m=(-3.0, 3.0), y_m=(-2.0, 2.0), z_m=(0.0, 2.5)),
    Guard(),
    limit_m=0.15,
    speed_mps=2.0,
    acceleration_mps2=3.0,
)
STILL = State((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.9, Mode.FOLLOW, True)
WELL = Situation(STILL, 0.0, Setpoint(STILL.p, STILL.v, STILL.v), (), ((1.5, 0.0, 0.3),), 0.1, 0.1, 0.001)


def state(**changes: object) -> State:
    values = {name: getattr(STILL, name) for name in State.__dataclass_fields__}
    return State(**values | changes)  # type: ignore[arg-type]


def seen(**changes: object) -> Situation:
    """All is well, but for ``changes``: of the situation, or of the vehicle's state."""
    own = {name: value for name, value in changes.items() if name in State.__dataclass_fields__}
    other = {name: value for name, value in changes.items() if name not in own}
    return WELL._replace(state=state(**own), setpoint=None, **other)  # type: ignore[arg-type]


def test_where_nothing_is_wrong_it_passes() -> None:
    assert judge(WELL, BOUNDS) == (Action.PASS, ())


def test_who_flies_alone_needs_nobody_to_hear() -> None:
    assert judge(seen(peers_s=None, operator_s=None, clock_s=None), BOUNDS).action is Action.PASS


CASES: list[tuple[str, Situation, Action, str]] = [
    ("about to leave the fence", seen(p=(2.8, 0.0, 1.0), v=(1.5, 0.0, 0.0)), Action.HOLD, "fence is ahead"),
    ("at the fence, going back", seen(p=(2.9, 0.0, 1.0), v=(-1.5, 0.0, 0.0)), Action.PASS, ""),
    ("out of the fence", seen(p=(3.1, 1.0, 1.0)), Action.HOLD, "0.10 m out"),
    ("far out of the fence", seen(p=(0.0, 2.6, 1.0)), Action.LAND, "0.60 m out"),
    ("above the fence", seen(p=(0.0, 0.0, 3.1)), Action.LAND, "0.60 m out"),
    ("an old position", seen(age_s=0.2), Action.HOLD, "position 0.20 s old"),
    ("a very old position", seen(age_s=0.6), Action.LAND, "position 0.60 s old"),
    ("never a position", seen(age_s=math.inf), Action.LAND, "position"),
    ("a jump", seen(jump_m=0.6), Action.HOLD, "jumped 0.60 m"),
    ("a clock ahead", seen(clock_s=0.05), Action.HOLD, "clock off by 50 ms"),
    ("a clock behind", seen(clock_s=-0.05), Action.HOLD, "clock off by 50 ms"),
    ("a clock lost", seen(clock_s=-1.0), Action.LAND, "clock off by 1000 ms"),
    ("peers lost", seen(peers_s=5.5), Action.HOLD, "too few drones heard for 5.5 s"),
    ("operator lost", seen(operator_s=6.0), Action.HOLD, "operator not heard for 6.0 s"),
    ("operator long lost", seen(operator_s=11.0), Action.LAND, "operator not heard"),
    ("battery", seen(battery=0.15, low_s=2.1), Action.LAND, "battery at 15 % for 2.1 s"),
    ("a battery that sags", seen(battery=0.15, low_s=1.9), Action.PASS, ""),
    ("tilt", seen(tilt=1.0), Action.LAND, "tilted by 57 degrees"),
    ("turned over", seen(tilt=3.0), Action.KILL, "turned over"),
    ("head on", seen(v=(1.0, 0.0, 0.0), movers=(Mover(4, (0.7, 0.05, 1.0), (-1.0, 0.0, 0.0)),)), Action.HOLD,
     "about to hit drone 4"),
    ("head on, far away", seen(v=(0.5, 0.0, 0.0), movers=(Mover(4, (1.4, 0.0, 1.0), (-1.0, 0.0, 0.0)),)), Action.PASS, ""),
    ("too near for the time it may be late", seen(v=(1.0, 0.0, 0.0), movers=(Mover(4, (0.4, 0.0, 1.0), (0.0, 0.0, 0.0)),)),
     Action.HOLD, "about to hit drone 4"),
    ("side by side", seen(v=(1.0, 0.0, 0.0), movers=(Mover(4, (0.0, 0.2, 1.0), (1.0, 0.0, 0.0)),)), Action.PASS, ""),
    ("one below", seen(v=(1.0, 0.0, 0.0), movers=(Mover(4, (0.3, 0.0, 0.2), (0.0, 0.0, 0.0)),)), Action.PASS, ""),
    ("an obstacle ahead", seen(p=(0.7, 0.0, 1.0), v=(1.5, 0.0, 0.0)), Action.HOLD, "about to hit obstacle 0"),
    ("an obstacle beside", seen(p=(1.4, 0.5, 1.0), v=(1.5, 0.0, 0.0)), Action.PASS, ""),
    ("a setpoint far away", WELL._replace(setpoint=Setpoint((1.1, 0.0, 1.0), STILL.v, STILL.v)), Action.HOLD, "1.10 m away"),
    ("a setpoint too fast", WELL._replace(setpoint=Setpoint(STILL.p, (3.1, 0.0, 0.0), STILL.v)), Action.HOLD, "3.10 m/s"),
    ("a setpoint that is no number", WELL._replace(setpoint=Setpoint((math.nan, 0.0, 1.0), STILL.v, STILL.v)), Action.HOLD,
     "setpoint"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("situation", "action", "why"), [case[1:] for case in CASES], ids=[case[0] for case in CASES]
)
def test_what_is_wrong_is_said_and_done(situation: Situation, action: Action, why: str) -> None:
    verdict = judge(situation, BOUNDS)
    assert verdict.action is action
    assert why in "; ".join(verdict.reasons)
    assert bool(verdict.reasons) == (action is not Action.PASS)


def test_the_strongest_wins_and_all_is_told() -> None:
    verdict = judge(seen(battery=0.1, low_s=9.0, clock_s=0.05, tilt=3.0), BOUNDS)
    assert verdict.action is Action.KILL
    assert len(verdict.reasons) == 3


@given(st.floats(0.0, 20.0), st.floats(0.0, 20.0))
def test_what_is_worse_is_never_judged_milder(one: float, other: float) -> None:
    for name in ("age_s", "peers_s", "operator_s", "clock_s"):
        low, high = (judge(seen(**{name: value}), BOUNDS).action for value in sorted((one, other)))
        assert low <= high


@given(
    st.tuples(st.floats(-2.9, 2.9), st.floats(-1.9, 1.9)),
    st.floats(0.0, 2 * math.pi),
    st.floats(0.0, 2.0),
)
def test_who_brakes_when_it_is_told_to_stays_in_the_fence(
    at: tuple[float, float], course: float, speed: float
) -> None:
    """Flies straight on until the guard says hold, goes on for the time it may be late, brakes with what it has."""
    x, y = at
    vx, vy = speed * math.cos(course), speed * math.sin(course)
    stop = speed / 3.0 / 2 + 0.14
    if not (-3 <= x + vx * stop <= 3 and -2 <= y + vy * stop <= 2):
        return  # it was not let in like that
    for _ in range(1000):
        if judge(seen(p=(x, y, 1.0), v=(vx, vy, 0.0), obstacles=()), BOUNDS).action is not Action.PASS:
            break
        x, y = x + 0.01 * vx, y + 0.01 * vy
    assert -3 <= x + vx * stop <= 3
    assert -2 <= y + vy * stop <= 2
