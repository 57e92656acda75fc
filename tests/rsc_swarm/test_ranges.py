"""Drones by their numbers: what people write is read, or refused in one line that says what would be right."""

import pytest

from rsc_swarm.flight.ranges import RangeError, numbers_in, written


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("0", (0,)),
        ("0-3", (0, 1, 2, 3)),
        ("7,0-2, 5", (7, 0, 1, 2, 5)),
        ("4-4", (4,)),
        ("249", (249,)),
        ("007", (7,)),
    ],
)
def test_numbers_and_ranges_are_read(text: str, numbers: tuple[int, ...]) -> None:
    assert numbers_in(text) == numbers


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "'' is neither a drone's number nor a range; write 0-11,13 say"),
        ("0,", "'' in '0,' is neither"),
        ("1-", "'1-' is neither"),
        ("-1", "'-1' is neither"),
        ("0-3-5", "'0-3-5' is neither"),
        ("0..3", "'0..3' is neither"),
        ("1.5", "'1.5' is neither"),
        ("\u0663", "is neither"),
        ("all", "'all' is neither"),
        ("0,9-5", "'9-5' in '0,9-5' goes downwards; write 5-9"),
        ("250", "'250': there is no drone 250; they are numbered 0 to 249"),
        ("0-999999999", "there is no drone 999999999"),
        ("0-9999999999", "is neither"),
        ("0-3,3", "'0-3,3' names drone 3 twice; name each drone once"),
        ("5,5", "names drone 5 twice"),
    ],
)
def test_anything_else_is_refused_in_one_line(text: str, complaint: str) -> None:
    with pytest.raises(RangeError) as refused:
        numbers_in(text)
    assert complaint in str(refused.value)
    assert "\n" not in str(refused.value)


def test_they_are_written_as_short_as_can_be_and_read_again() -> None:
    assert written([13, 0, 1, 2, 9, 10]) == "0-2,9-10,13"
    assert numbers_in(written(range(0, 250, 2))) == tuple(range(0, 250, 2))
    assert written([]) == ""
