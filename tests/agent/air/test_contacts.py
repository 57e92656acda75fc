"""What a drone knows of the others from their beacons."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent.air.contacts import OPERATOR, Contacts
from protocols.wire.beacon import NO_TICK, Beacon

STILL = (0.0, 0.0, 0.0)


def beacon(sender: int, utc_us: int = 1_000_000, tick: int = NO_TICK, **fields: object) -> Beacon:
    return Beacon(sender, 0, 0, tick, utc_us, STILL, STILL, 0, 90, True)._replace(**fields)  # type: ignore[arg-type]


def test_what_is_doubled_or_overtaken_is_heard_once() -> None:
    contacts = Contacts(0)
    contacts.hear(beacon(1, 2_000_000, 5), b"new", 2_000_000, 0.0)
    contacts.hear(beacon(1, 2_000_000, 5), b"again", 2_000_000, 0.0)
    contacts.hear(beacon(1, 1_000_000, 4), b"old", 2_000_000, 0.0)
    contacts.hear(beacon(0, 2_000_000, 5), b"mine", 2_000_000, 0.0)
    assert contacts.frames(6) == [(1, b"new")]


def test_a_frame_of_the_future_waits_for_its_time_unless_that_is_far() -> None:
    contacts = Contacts(0)
    contacts.hear(beacon(1, tick=10), b"soon", 0, 0.0)
    contacts.hear(beacon(2, tick=30), b"never", 0, 0.0)
    assert contacts.frames(10) == []
    assert contacts.frames(11) == [(1, b"soon")]
    assert contacts.frames(31) == []


def test_who_falls_silent_in_flight_stops_where_it_got_in_a_second_and_is_gone_when_it_lands() -> None:
    contacts = Contacts(0)
    contacts.hear(beacon(1, v=(2.0, 0.0, 0.0)), b"", 0, 100.0)
    (mover,) = contacts.movers(100.5)
    assert (mover.p, mover.v) == ((1.0, 0.0, 0.0), (2.0, 0.0, 0.0))
    (mover,) = contacts.movers(103.0)
    assert (mover.p, mover.v) == ((2.0, 0.0, 0.0), STILL)
    assert contacts.movers(104.5) == ()


@pytest.mark.parametrize(
    ("others", "heard", "enough"),
    [(5, 2, False), (5, 3, True), (1, 0, False), (1, 1, True), (2, 1, True), (4, 1, False)],
)
def test_in_a_swarm_that_is_parted_at_most_one_part_goes_on(others: int, heard: int, enough: bool) -> None:
    contacts = Contacts(0)
    for other in range(1, others + 1):
        contacts.hear(beacon(other), b"", 0, 0.0)
    for other in range(1, heard + 1):
        contacts.hear(beacon(other, 2_000_000), b"", 0, 10.0)
    few_s = contacts.few_s(others, 10.0)
    assert few_s is not None
    assert (few_s == 0.0) == enough


def test_who_is_alone_misses_nobody() -> None:
    assert Contacts(0).few_s(0, 1.0) is None


@given(st.floats(-1.0, 1.0), st.lists(st.floats(0.001, 0.3), min_size=1, max_size=30))
def test_a_clock_is_told_but_for_the_quickest_way(off_s: float, ways: list[float]) -> None:
    contacts = Contacts(0)
    for step, way in enumerate(ways):
        for who in (1, 2, OPERATOR):
            at_us = 10_000_000 + 20_000 * step
            contacts.compare_clocks(who, at_us, at_us + round(1e6 * (off_s + way)), 0.02 * step)
    told = contacts.clock_s(0.02 * len(ways))
    assert told is not None
    assert told - off_s == pytest.approx(min(ways), abs=1e-5)


def test_one_wrong_clock_among_others_makes_nobody_else_wrong() -> None:
    contacts = Contacts(0)
    for who in range(1, 6):
        contacts.compare_clocks(who, 0, 500_000 if who == 3 else 1_000, 0.0)
    assert contacts.clock_s(0.1) == pytest.approx(0.001)
    assert contacts.clock_s(5.0) is None
