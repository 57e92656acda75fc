"""What callers of the public door hand over, checked: a wrong kind of thing is named, with what would be right."""

import operator
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from protocols.mission.document import Mission, MissionError
from protocols.mission.findings import shown

_T = TypeVar("_T")
A_MISSION = "a Mission, as rs.mission(...) makes it"


def one_of(name: str, given: object, kind: type[_T], made_by: str) -> _T:
    """One of a kind it must be.

    Raises:
        MissionError: it is something else; ``made_by`` says what would be right.
    """
    if not isinstance(given, kind):
        raise MissionError(f"{name}: give {made_by}, not {shown(given)}")
    return given


def one_or_several(name: str, given: object, kind: type[_T], made_by: str) -> list[_T]:
    """One of a kind, or all that something yields.

    Raises:
        MissionError: as `one_of`.
    """
    given = plain(given)  # an array may hold them
    several = (
        given if isinstance(given, Iterable) and not isinstance(given, kind | str | bytes | dict) else [given]
    )
    return [one_of(name, one, kind, made_by) for one in several]


def a_mission(given: object) -> Mission:
    """A mission it must be.

    Raises:
        MissionError: it is something else.
    """
    return one_of("mission", given, Mission, A_MISSION)


def whole(name: str, given: object) -> int:
    """A whole number it must be, Python's or NumPy's.

    Raises:
        MissionError: it is something else.
    """
    try:
        return operator.index(given)  # type: ignore[arg-type]
    except TypeError:
        raise MissionError(f"{name}: give a whole number, not {shown(given)}") from None


def a_path(name: str, given: object) -> Path:
    """A path it must be: text, or a `Path`.

    Raises:
        MissionError: it is something else.
    """
    path = os.fspath(given) if isinstance(given, str | os.PathLike) else None
    if not isinstance(path, str) or not path or "\0" in path:
        raise MissionError(f"{name}: give a path, not {shown(given)}")
    return Path(path)


def plain(value: Any) -> Any:
    """Python's own numbers and lists for NumPy's, at any depth."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {name: plain(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    return value
