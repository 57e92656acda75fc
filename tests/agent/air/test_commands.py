"""What a drone makes of what its operator says, again and again."""

from agent.air.commands import Commands
from protocols.wire.operator import Order, Word

PATIENCE_S = 5.0


def heard(*words: tuple[float, int, Order]) -> tuple[list[Order | None], Commands]:
    """What each is worth that came then, with that number."""
    commands = Commands(PATIENCE_S)
    return [commands.hear(Word(number, order, 0, 0), at) for at, number, order in words], commands


def test_what_is_new_is_ordered_once() -> None:
    told, commands = heard(
        (0.0, 7, Order.NONE), (0.1, 8, Order.ARM), (0.2, 8, Order.ARM), (0.3, 9, Order.TAKEOFF)
    )
    assert told == [None, Order.ARM, None, Order.TAKEOFF]
    assert commands.silent_s(1.3) == 1.0


def test_what_was_ordered_before_anything_was_heard_is_not_obeyed() -> None:
    told, commands = heard((0.0, 8, Order.TAKEOFF), (0.1, 8, Order.TAKEOFF))
    assert told == [None, None]
    assert commands.silent_s(0.1) == 0.0


def test_what_was_overtaken_is_nothing_and_no_sign_of_life() -> None:
    told, commands = heard((0.1, 8, Order.ARM), (0.2, 9, Order.LAND), (9.0, 8, Order.ARM))
    assert told == [None, Order.LAND, None]
    assert commands.silent_s(9.2) == 9.0


def test_numbers_begin_anew_some_day() -> None:
    assert heard((0.0, 0xFFFFFFFF, Order.NONE), (0.1, 0, Order.KILL))[0] == [None, Order.KILL]


def test_another_operator_whose_clock_was_set_back_is_obeyed_when_the_first_is_silent() -> None:
    """His numbers count from the time at which he started."""
    hour = 3_600_000
    told, commands = heard(
        (0.0, hour, Order.ARM), (3.0, 5, Order.NONE), (9.0, 5, Order.NONE), (9.1, 6, Order.KILL)
    )  # fmt: skip
    assert told == [None, None, None, Order.KILL]
    assert commands.silent_s(9.1) == 0.0
