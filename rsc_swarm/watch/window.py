"""The flight's end of a live page: it shows pictures through a socket that never makes it wait, and lays hands on the flight.

One message of the socket is one picture, or one JSON object, by its first byte; a picture for which the socket has no room is not
shown. What hands want comes the other way as JSON objects (`rsc_swarm.watch.hands`), and is told to all pages.
"""

import json
import select
import socket
import time
from collections import deque
from contextlib import suppress
from typing import Any

from protocols.dynamics import TICK_S
from protocols.errors import SwarmError
from rsc_swarm.watch.hands import Hand, HandError, Pace, read_hand
from world.director import Director
from world.outlets.picture import picture, scene

PICTURE, WORD = b"P", b"J"
EVERY_S = 0.08  # between two pictures; a page draws what lies between them
_LONGEST_WAIT_S = 0.05
_LONGEST_HAND = 1 << 16


class Window:
    """Shows one flight (world.outlets.onlooker.Onlooker)."""

    def __init__(self, end: socket.socket, pace: Pace = Pace(), paced: bool = True) -> None:  # noqa: B008  it is frozen
        """``end``: of a socket that keeps messages whole. ``paced``: whether the flight may be kept waiting; not by the clock."""
        self._end = end
        end.setblocking(False)
        self._pace, self._paced = pace, paced
        self._unsaid: deque[bytes] = deque()
        self._began = self._shown = float("-inf")
        self._shown_tick = -1
        self._from = (0.0, 0)  # wall clock and tick from which the pace counts

    def attend(self, director: Director) -> float:
        """Lay hands on the flight, and show it if that is due; how long to wait."""
        core, now = director.core, time.monotonic()
        tick, over = director.clock, not director.core.active[0]
        if self._shown_tick < 0:
            self._began, self._from = now, (now, tick)
            self.say({"kind": "scene", "scene": scene(core)})
            self._tell_pace()
        elif not over:
            self._take_hands(director, now)
        if (now - self._shown >= EVERY_S or over) and tick != self._shown_tick:
            self._shown, self._shown_tick = now, tick
            factor = tick * TICK_S / max(now - self._began, 1e-9)
            self.show(picture(core, director.statuses, factor, plans=director.plans()).packed())
        return 0.0 if over else self._wait_s(tick, now)

    def show(self, packed: bytes) -> None:
        """Show a picture, if there is room: else newer ones will come."""
        if self._say_all():
            with suppress(OSError):  # or nobody serves the page any more
                self._end.send(PICTURE + packed)

    def say(self, word: dict[str, Any]) -> None:
        """Tell all pages a JSON object; as soon as there is room."""
        self._unsaid.append(WORD + json.dumps(word, separators=(",", ":")).encode())
        self._say_all()

    def give(self, packed: bytes) -> None:
        """Show a picture that is not to be left out: wait until there is room."""
        self._unsaid.append(PICTURE + packed)
        self.see_off(float("inf"))

    def see_off(self, within_s: float) -> None:
        """Say what is unsaid, and wait for room, but no longer than that."""
        deadline = time.monotonic() + within_s
        while not self._say_all() and (left := deadline - time.monotonic()) > 0:
            select.select([], [self._end], [], min(left, 1.0))

    def _take_hands(self, director: Director, now: float) -> None:
        while True:
            try:
                message = self._end.recv(_LONGEST_HAND)
            except OSError:  # nothing there, or nobody
                return
            if not message:
                return
            try:
                self._lay(read_hand(message), director, now)
            except SwarmError as error:
                self.say({"kind": "refused", "text": str(error)})

    def _lay(self, hand: Hand, director: Director, now: float) -> None:
        """Let a hand have its way.

        Raises:
            protocols.mission.document.MissionError: its fault would have no effect. HandError: it cannot have it.
        """
        tick = director.clock
        if hand.fault is not None:
            director.core.lay_hand(0, hand.fault)
            told = {
                "kind": "hand",
                "tick": tick,
                "fault": director.core.by_hand[0][-1].model_dump(mode="json"),
            }
            self.say(told)
        elif not self._paced:
            raise HandError("a flight on the wall clock goes at the pace of the clock")
        else:
            self._pace, self._from = hand.pace or self._pace, (now, tick)
            self._tell_pace()

    def _tell_pace(self) -> None:
        if self._paced:
            self.say({"kind": "pace", "paused": self._pace.paused, "speed": self._pace.speed})

    def _wait_s(self, tick: int, now: float) -> float:
        if self._pace.paused:
            return _LONGEST_WAIT_S
        if self._pace.speed is None:
            return 0.0
        since, first = self._from
        return min(max(0.0, since + (tick - first) * TICK_S / self._pace.speed - now), _LONGEST_WAIT_S)

    def _say_all(self) -> bool:
        """Say what is unsaid, as far as there is room; whether that is all."""
        while self._unsaid:
            try:
                self._end.send(self._unsaid[0])
            except BlockingIOError:
                return False
            except OSError:
                pass  # longer than the socket is wide, or nobody is there
            self._unsaid.popleft()
        return True
