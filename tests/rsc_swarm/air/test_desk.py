"""What an operator types, and what is ordered then."""

import io

import pytest
from rich.console import Console

from agent.air.pilot import Phase
from protocols.wire.operator import Order
from rsc_swarm.air.desk import Desk
from rsc_swarm.air.station import Station
from rsc_swarm.show.fleet_view import order_text, table, troubles_text
from tests.rsc_swarm.air.stations import hear, station

NOW = 100.0


def typed(text: str, phase: Phase = Phase.FLY, desk: Desk | None = None) -> tuple[Station, Desk, bool]:
    """What comes of typing this while all drones are in this phase."""
    fleet, desk = station(), desk or Desk()
    hear(fleet, NOW, phase)
    stays = [desk.press(key, fleet, 0, NOW) for key in text]
    return fleet, desk, all(stays)


@pytest.mark.parametrize("order", [Order.HOLD, Order.LAND, Order.ABORT, Order.KILL])
def test_a_word_goes_with_enter_and_not_before(order: Order) -> None:
    assert typed(order.value)[0].ordered is Order.NONE
    fleet, desk, stays = typed(f"{order.value}\n")
    assert (fleet.ordered, desk.typed, stays) == (order, "", True)
    assert order_text(fleet) == f"ordered: {order}"


@pytest.mark.parametrize(("key", "order"), [("L", Order.LAND), ("A", Order.ABORT), ("K", Order.KILL)])
@pytest.mark.parametrize("before", ["", "ho", "land", "was ist das"])
def test_three_capitals_act_at_once_whatever_has_been_typed(key: str, order: Order, before: str) -> None:
    fleet, desk, _ = typed(before + key)
    assert (fleet.ordered, desk.typed) == (order, "")


def test_with_caps_lock_on_words_are_words() -> None:
    fleet, desk, _ = typed("TAKEOFF", Phase.ARMED)
    assert (fleet.ordered, desk.typed) == (Order.NONE, "TAKEOFF")
    assert typed("TAKEOFF\n", Phase.ARMED)[0].ordered is Order.TAKEOFF
    assert typed("HOLD\n")[0].ordered is Order.HOLD


@pytest.mark.parametrize(
    "wrong", ["k", "l", "a", "x", "hold it\n", "kil\n", "\n", "  \n", "\x1b", "\t", "\x01", "ö\n", "9" * 99]
)
def test_what_is_no_order_orders_nothing(wrong: str) -> None:
    fleet, desk, stays = typed(wrong)
    assert (fleet.ordered, stays) == (Order.NONE, True)
    assert len(desk.typed) <= 40
    if wrong.strip() and wrong.endswith("\n"):
        assert desk.answer.startswith(f"{wrong.strip()!r} is no order; known: preflight, arm, takeoff")


def test_what_was_typed_wrong_is_mended() -> None:
    assert typed("hop\x7fld\n")[0].ordered is Order.HOLD
    assert typed("hop\bld\n")[0].ordered is Order.HOLD
    assert typed("nonsense\x15hold\n")[0].ordered is Order.HOLD


def test_who_quits_leaves() -> None:
    assert typed("quit\n")[2] is False


def test_preflight_says_what_speaks_against_flying() -> None:
    fleet, desk, _ = typed("preflight\n", Phase.GROUND)
    assert desk.answer == troubles_text(fleet, NOW).plain == "preflight is green"
    hear(fleet, NOW, Phase.GROUND, complaints=("battery at 3 %",))
    for key in "preflight\narm\n":
        desk.press(key, fleet, 0, NOW)
    assert desk.answer == "arm: preflight is not green: drone 0: battery at 3 %; and 5 more"
    assert fleet.ordered is Order.NONE


@pytest.mark.parametrize(
    ("off_s", "why"),
    [
        (3600.0, "its clock is 3600.0 s behind the operator's"),
        (-3600.0, "its clock is 3600.0 s ahead of the operator's"),
        (0.1, ""),
    ],
)
def test_an_operator_with_another_time_of_day_is_told_so(off_s: float, why: str) -> None:
    """By it `go` is agreed on; and drones whose words are of an hour ago are not silent."""
    fleet = station()
    hear(fleet, NOW, Phase.GROUND, late_s=off_s)
    assert fleet.red(NOW) == [
        f"drone {drone}: {why}; keep both by chrony or PTP" for drone in range(6) if why
    ]


@pytest.mark.parametrize(
    ("word", "phases", "why"),
    [
        ("arm", [Phase.GROUND] * 5 + [Phase.FLY], "arm: drone 5 is in phase fly; wait until all are in ground"),
        ("takeoff", [Phase.ARMED] * 5 + [Phase.GROUND], "takeoff: drone 5 is in phase ground; wait until all are in armed"),
        ("go", [Phase.FORM] * 4 + [Phase.CLIMB, Phase.FORM], "go: drone 4 is in phase climb; wait until all are in form"),
        ("arm", [Phase.DEAD] + [Phase.GROUND] * 5, "arm: drone 0's motors were cut; end its process and start it again"),
    ],
)  # fmt: skip
def test_nothing_begins_before_all_are_ready_for_it(word: str, phases: list[Phase], why: str) -> None:
    fleet, desk = station(), Desk()
    hear(fleet, NOW, *phases)
    for key in f"{word}\n":
        desk.press(key, fleet, 0, NOW)
    assert desk.answer in (why, f"{why}, or land")
    assert (fleet.ordered, fleet.go_tick) == (Order.NONE, None)
    desk.press("L", fleet, 0, NOW)
    assert fleet.ordered is Order.LAND
    assert desk.answer == ""


def test_an_order_is_not_carried_on_by_who_is_not_heard() -> None:
    fleet, desk = station(), Desk()
    for key in "go\n":
        desk.press(key, fleet, 0, NOW)
    assert desk.answer.startswith("go: preflight is not green: drone 0: is not heard at udp/127.0.0.1:7451")


def test_who_does_not_fly_on_is_told_with_the_reason_once_for_all_that_share_it() -> None:
    fleet = station()
    hear(fleet, NOW, *[Phase.HOLD] * 3, Phase.FLY, Phase.LAND, Phase.HOLD)
    assert troubles_text(fleet, NOW).plain == "drones 0-2,5: hold, climbed\ndrone 4: land, climbed"


@pytest.mark.parametrize(("width", "columns"), [(120, 11), (80, 11), (60, 8), (40, 6), (30, 4), (12, 2)])
def test_the_table_fits_on_the_terminal(width: int, columns: int) -> None:
    fleet = station()
    hear(fleet, NOW, Phase.ARMED, p=(-12.34, -12.34, 12.34))
    shown = table(fleet, NOW, width)
    assert len(shown.columns) == columns
    told = io.StringIO()
    Console(file=told, width=width).print(shown)
    assert "…" not in told.getvalue()
    assert len(told.getvalue().splitlines()) == 1 + 6
