"""The flight's end of a live page: it shows pictures through a socket that never makes it wait, and takes in what hands want.

One message of the socket is one picture, or one JSON object, by its first byte; what the socket has no room for is not shown.
"""

import json
import socket
import time
from contextlib import suppress
from typing import Any

from protocols.dynamics import TICK_S
from world.director import Director
from world.outlets.picture import picture, scene

PICTURE, WORD = b"P", b"J"
_EVERY_S = 0.04  # between two pictures
_EVERY_TICKS = 10  # and no more of the flight than this, where it is fast
_LONGEST_WAIT_S = 0.05


class Window:
    """Shows one flight (world.outlets.onlooker.Onlooker)."""

    def __init__(self, end: socket.socket, speed: float | None = None) -> None:
        """``end``: of a socket that keeps messages whole. ``speed``: times real time at most; None: as fast as it goes."""
        self._end = end
        end.setblocking(False)
        self._speed = speed
        self._began = self._shown = float("-inf")
        self._shown_tick = -1
        self._from = (0.0, 0)  # wall clock and tick from which the speed counts

    def attend(self, director: Director) -> float:
        """Show the flight if that is due; how long to wait."""
        core, now = director.core, time.monotonic()
        tick = director.clock
        if self._shown_tick < 0:
            self._began, self._from = now, (now, tick)
            self.say({"kind": "scene", "scene": scene(core)})
        over = not core.active[0]
        due = now - self._shown >= _EVERY_S or tick - self._shown_tick >= _EVERY_TICKS
        if (due or over) and tick != self._shown_tick:
            self._shown, self._shown_tick = now, tick
            factor = tick * TICK_S / max(now - self._began, 1e-9)
            self._send(PICTURE + picture(core, director.statuses, factor).packed())
        return 0.0 if over else self._wait_s(tick, now)

    def say(self, word: dict[str, Any]) -> None:
        """Tell all pages a JSON object."""
        self._send(WORD + json.dumps(word, separators=(",", ":")).encode())

    def _wait_s(self, tick: int, now: float) -> float:
        if self._speed is None:
            return 0.0
        since, first = self._from
        return min(max(0.0, since + (tick - first) * TICK_S / self._speed - now), _LONGEST_WAIT_S)

    def _send(self, message: bytes) -> None:
        # Full, or too long for the socket: newer pictures will come. Broken: nobody serves the page any more.
        with suppress(OSError):
            self._end.send(message)
