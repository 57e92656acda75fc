"""What a drone knows of the others from their beacons."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent.air.contacts import Contacts
from agent.air.reach import Leash, Reach
from protocols.wire.beacon import NO_TICK, NOBODY, Beacon

STILL = (0.0, 0.0, 0.0)
REACH = Reach(3.0, 10.0, 0.5)


def beacon(sender: int, utc_us: int = 1_000_000, tick: int = NO_TICK, **fields: object) -> Beacon:
    return Beacon(sender, 0, 0, tick, utc_us, STILL, STILL, 0, NOBODY, 0, 90, True)._replace(**fields)  # type: ignore[arg-type]


def test_what_is_doubled_or_overtaken_is_heard_once() -> None:
    contacts = Contacts(0, REACH)
    contacts.hear(beacon(1, 2_000_000, 5), b"new", 2_000_000, 0.0)
    contacts.hear(beacon(1, 2_000_000, 5), b"again", 2_000_000, 0.0)
    contacts.hear(beacon(1, 1_000_000, 4), b"old", 2_000_000, 0.0)
    contacts.hear(beacon(0, 2_000_000, 5), b"mine", 2_000_000, 0.0)
    assert contacts.frames(6) == [(1, b"new")]


@pytest.mark.parametrize(("flying", "heard"), [(False, True), (True, False)])
def test_who_stands_may_have_its_clock_set_back(flying: bool, heard: bool) -> None:
    """As chrony does after a start, where an hour was wrong: it would not be heard for an hour."""
    contacts, hour = Contacts(0, REACH), 3_600_000_000
    contacts.hear(beacon(1, 2 * hour, flying=flying), b"", 2 * hour, 0.0)
    contacts.hear(beacon(1, hour, flying=flying, battery=80), b"", 2 * hour, 1.0)
    assert (contacts.known()[1].beacon.battery == 80) == heard


def test_a_frame_of_the_future_waits_for_its_time_unless_that_is_far() -> None:
    contacts = Contacts(0, REACH)
    contacts.hear(beacon(1, tick=10), b"soon", 1_000_000, 0.0)
    contacts.hear(beacon(2, tick=30), b"never", 1_000_000, 0.0)
    assert contacts.frames(10) == []
    assert contacts.frames(11) == [(1, b"soon")]
    assert contacts.frames(31) == []


def test_who_falls_silent_in_flight_stops_where_it_got_in_a_second_and_is_gone_when_it_lands() -> None:
    contacts = Contacts(0, REACH)
    contacts.hear(beacon(1, v=(2.0, 0.0, 0.0)), b"", 1_200_000, 100.2)  # 0.2 s under way
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
    contacts = Contacts(0, REACH)
    for other in range(1, others + 1):
        contacts.hear(beacon(other), b"", 0, 0.0)
    for other in range(1, heard + 1):
        contacts.hear(beacon(other, 2_000_000), b"", 0, 10.0)
    few_s = contacts.few_s(others, 10.0)
    assert few_s is not None
    assert (few_s == 0.0) == enough


def test_who_is_alone_misses_nobody() -> None:
    assert Contacts(0, REACH).few_s(0, 1.0) is None


def talk(
    contacts: Contacts, there_ms: float, back_ms: float, since: float = 0.0, others: int = 3
) -> float | None:
    """Others come ``there_ms`` late and say that drone 0 comes ``back_ms`` late, for 6 s; the clock as drone 0 has it then."""
    told = None
    for step in range(150):
        now = since + 0.04 * step
        for who in range(1, 1 + others):
            said = 1_000_000 + round(1e6 * now)
            way = round(1000 * there_ms)
            contacts.hear(beacon(who, said, about=0, late_ms=round(back_ms)), b"", said + way, now)
        told = contacts.clock_s(now)
    return told


@given(st.integers(-400, 400), st.integers(1, 300))
def test_a_clock_is_told_whatever_holds_up_all_that_is_said(off_ms: int, way_ms: int) -> None:
    assert talk(Contacts(0, REACH), way_ms + off_ms, way_ms - off_ms) == pytest.approx(
        off_ms / 1000, abs=0.001
    )


def test_what_was_held_up_for_a_moment_says_nothing_of_a_clock() -> None:
    contacts = Contacts(0, REACH)
    assert talk(contacts, 1, 1) == pytest.approx(0.0)
    for step in range(10):
        said = 10_000_000 + 40_000 * step
        contacts.hear(beacon(1, said), b"", said + 600_000, 9.0 + 0.04 * step)
        assert (contacts.clock_s(9.0 + 0.04 * step) or 0.0) == pytest.approx(0.0)


def test_one_wrong_clock_among_others_makes_nobody_else_wrong() -> None:
    contacts = Contacts(0, REACH)
    for step in range(150):
        for who in range(1, 6):
            said, off = 1_000_000 + 40_000 * step, 500 if who == 3 else 0
            contacts.hear(
                beacon(who, said, about=0, late_ms=1 - off), b"", said + 1000 * (1 + off), 0.04 * step
            )
    assert contacts.clock_s(5.96) == pytest.approx(0.0)


def test_all_that_are_heard_are_told_of_in_turn() -> None:
    contacts = Contacts(0, REACH)
    assert contacts.lateness(0, 0.0) == (NOBODY, 0)
    talk(contacts, 7, 7)
    assert {contacts.lateness(turn, 5.96) for turn in range(3)} == {(1, 7), (2, 7), (3, 7)}


def test_who_says_much_takes_no_frame_of_another_away() -> None:
    contacts = Contacts(0, REACH)
    for number in range(5000):
        contacts.hear(beacon(1, 1_000_000 + number, tick=3), b"%d" % number, 1_000_000, 0.0)
        if number == 2500:
            contacts.hear(beacon(2, tick=3), b"honest", 1_000_000, 0.0)
    frames = contacts.frames(4)
    assert (2, b"honest") in frames
    assert (1, b"4999") in frames
    assert len(frames) < 20


def test_of_two_others_the_clock_of_one_makes_nobody_wrong() -> None:
    contacts = Contacts(0, REACH)
    for step in range(150):
        for who in (1, 2):
            said, late_ms = 1_000_000 + 40_000 * step, -30_000 if who == 2 else 1
            contacts.hear(beacon(who, said, about=0, late_ms=late_ms), b"", said + 1000, 0.04 * step)
    assert contacts.clock_s(5.96) == pytest.approx(0.0)


@pytest.mark.parametrize("late_s", [0.0, 0.3])
def test_a_drone_that_flies_is_believed_as_it_says(late_s: float) -> None:
    """At the speed limit in a circle; a fifth of its beacons is lost, and some are held up."""
    leash, fastest = Leash(REACH), 2.0
    for step in range(200):
        if step % 5 == 3:
            continue
        at = 0.04 * step
        p = (fastest * math.cos(at), fastest * math.sin(at), 1.0)
        v = (-fastest * math.sin(at), fastest * math.cos(at), 0.0)
        there, moving = leash.believed(p, v, at, at + (late_s if step % 7 == 0 else 0.0))
        assert there == pytest.approx(p)
        assert moving == pytest.approx(v)
        assert not leash.doubtful


def test_who_is_here_and_there_is_believed_to_be_where_a_drone_could_be() -> None:
    """A thousand beacons a second: now before one drone, now before another, and towards it as fast as a bullet."""
    leash, gone, at = Leash(REACH), [], STILL
    for step in range(1000):
        p = (5.0 if step % 2 else -5.0, 0.0, 1.0)
        now = 0.001 * step
        there, moving = leash.believed(p, (500.0, 0.0, 0.0), now, now)
        gone.append(math.dist(there[:2], at[:2]) if step else 0.0)
        at = there
        assert math.hypot(*moving[:2]) <= REACH.speed_mps + 1e-9
        assert leash.doubtful
    assert max(gone) <= REACH.speed_mps * 0.001 + 1e-9


def test_who_really_moved_on_unheard_is_found_again() -> None:
    leash = Leash(REACH)
    leash.believed((0.0, 0.0, 1.0), STILL, 0.0, 0.0)
    assert leash.believed((9.0, 0.0, 1.0), STILL, 4.0, 4.0)[0] == (9.0, 0.0, 1.0)
