"""Drones by their numbers, as people write them: ``0-11,13``."""

import re
from collections.abc import Iterable

from protocols.errors import SwarmError
from protocols.wire.keys import MAX_AGENTS

_PART = re.compile(r"([0-9]{1,9})(?:-([0-9]{1,9}))?")


class RangeError(SwarmError, ValueError):
    """It names no drones; one line says why, and what would be right."""


def numbers_in(text: str) -> tuple[int, ...]:
    """The numbers that ``text`` names, in the order in which it does.

    Raises:
        RangeError: something in it is neither a number nor a range, no drone has such a number, or one is named twice.
    """
    numbers: list[int] = []
    for part in map(str.strip, text.split(",")):
        where = repr(part) if part == text else f"{part!r} in {text!r}"
        found = _PART.fullmatch(part)
        if not found:
            raise RangeError(f"{where} is neither a drone's number nor a range; write 0-11,13 say")
        first, last = int(found[1]), int(found[2] or found[1])
        if last < first:
            raise RangeError(f"{where} goes downwards; write {last}-{first}")
        if last >= MAX_AGENTS:
            raise RangeError(f"{where}: there is no drone {last}; they are numbered 0 to {MAX_AGENTS - 1}")
        for number in range(first, last + 1):
            if number in numbers:
                raise RangeError(f"{text!r} names drone {number} twice; name each drone once")
            numbers.append(number)
    return tuple(numbers)


def written(numbers: Iterable[int]) -> str:
    """What `numbers_in` reads, as short as can be, in rising order."""
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and runs[-1][1] == number - 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    return ",".join(f"{first}" if first == last else f"{first}-{last}" for first, last in runs)
