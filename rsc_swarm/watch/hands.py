"""What somebody who looks on may do to a flight: bring about a fault of a mission, let the flight wait or go slowly."""

import json
from typing import Any, NamedTuple

from protocols.errors import SwarmError

_SLOWEST, _FASTEST = 0.01, 100.0


class HandError(SwarmError, ValueError):
    """No hand, or one that cannot have its way; one line says why."""


class Pace(NamedTuple):
    """How fast a flight goes. speed: times real time at most; None: as fast as it goes."""

    speed: float | None = None
    paused: bool = False


class Hand(NamedTuple):
    """One of the two: the fields of a fault (protocols.mission.fault), without its time; or another pace."""

    fault: dict[str, Any] | None = None
    pace: Pace | None = None


def _once(fields: list[tuple[str, Any]]) -> dict[str, Any]:
    """The fields of a JSON object. Raises ValueError if one is said twice: nobody could tell which is meant."""
    said = dict(fields)
    if len(said) < len(fields):
        raise ValueError("a field is said twice")
    return said


def read_hand(message: bytes) -> Hand:
    """``{"fault": {"kind": "kill", "agents": [3]}}``, or ``{"pace": {"speed": 0.5, "paused": false}}``.

    Raises:
        HandError: it is neither.
    """
    try:
        said = json.loads(message, object_pairs_hook=_once)
        if set(said) == {"fault"} and isinstance(said["fault"], dict) and "at_s" not in said["fault"]:
            return Hand(fault=said["fault"])
        speed, paused = said["pace"]["speed"], said["pace"]["paused"]
        number = type(speed) in (int, float) and _SLOWEST <= speed <= _FASTEST
        if isinstance(paused, bool) and (speed is None or number):
            return Hand(pace=Pace(None if speed is None else float(speed), paused))
    except (ValueError, TypeError, KeyError, RecursionError):
        pass
    raise HandError(
        "say a fault without its time, or a pace: a speed from 0.01 to 100 or null, and whether to pause"
    )
