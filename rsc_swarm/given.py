"""What callers of the public door hand over, checked: a wrong kind of thing is named, with what would be right."""

import operator
from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

import numpy as np

from protocols.mission.document import Mission, MissionError

_T = TypeVar("_T")
_MOST_CHARACTERS = 60


def shown(value: object) -> str:
    """The value on one line that is not too long."""
    text = " ".join(repr(value).split())
    return text if len(text) <= _MOST_CHARACTERS else f"{text[:_MOST_CHARACTERS]}..."


def a_mission(given: object) -> Mission:
    """A mission it must be.

    Raises:
        MissionError: it is something else.
    """
    if isinstance(given, Mission):
        return given
    hint = f"rs.mission({shown(given)}) makes one" if isinstance(given, str) else "rs.mission(...) makes one"
    raise MissionError(f"mission: give a Mission, not {shown(given)}; {hint}")


def missions_of(given: object) -> list[Mission]:
    """One mission, or all that something yields.

    Raises:
        MissionError: it is something else.
    """
    if isinstance(given, Mission | str | bytes | dict) or not isinstance(given, Iterable):
        return [a_mission(given)]
    return [a_mission(one) for one in given]


def one_or_several(name: str, given: object, kind: type[_T], made_by: str) -> list[_T]:
    """One of a kind, or several, as a list of at least one.

    Raises:
        MissionError: it is something else.
    """
    several: Sequence[Any] = (
        [given] if isinstance(given, kind) else given if isinstance(given, Sequence) else ()
    )
    if not several or not all(isinstance(one, kind) for one in several):
        raise MissionError(f"{name}: give {made_by}, or a list of them, not {shown(given)}")
    return list(several)


def whole(name: str, given: object) -> int:
    """A whole number it must be, Python's or NumPy's.

    Raises:
        MissionError: it is something else.
    """
    try:
        return operator.index(given)  # type: ignore[arg-type]
    except TypeError:
        raise MissionError(f"{name}: give a whole number, not {shown(given)}") from None


def plain(value: Any) -> Any:
    """Python's own numbers and lists for NumPy's, at any depth."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {name: plain(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    return value
