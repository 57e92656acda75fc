"""The live view of a flight: a map and a table on a terminal, one line per two simulated seconds elsewhere.

No threads: something is drawn when the view is told to, and at no other time; the launcher forks. What draws on terminals is
loaded at the first word that it is told: a launch's drones start meanwhile.
"""

import math
import sys
from types import TracebackType
from typing import TYPE_CHECKING, Self, TextIO

from rsc_swarm.show.line import line
from world.outlets.snapshot import Snapshot

if TYPE_CHECKING:
    from rsc_swarm.show.picture import Screen

_LINE_EVERY_S = 2.0


class View:
    """Shows snapshots of one flight while its ``with`` block lasts. ``last`` is the latest one."""

    def __init__(self, title: str, stream: TextIO | None = None) -> None:
        """``title`` says what is flown; ``stream`` is stderr unless given."""
        self._title, self._stream = title, stream or sys.stderr
        self._opened: Screen | None = None
        self._next_line_s = 0.0
        self.last: Snapshot | None = None

    @property
    def _screen(self) -> "Screen | None":
        if self._opened is None and self._stream.isatty():
            from rsc_swarm.show.picture import Screen

            self._opened = Screen(self._title, self._stream)
        return self._opened

    def update(self, snapshot: Snapshot) -> None:
        """Show this moment."""
        self.last = snapshot
        if screen := self._screen:
            screen.show(snapshot)
        elif snapshot.time_s >= self._next_line_s:
            self._next_line_s = (math.floor(snapshot.time_s / _LINE_EVERY_S) + 1) * _LINE_EVERY_S
            self.say(line(snapshot))

    def doing(self, text: str) -> None:
        """What is being done before there is a flight to see; on a terminal only, until the first `update`."""
        if screen := self._screen:
            screen.doing(text)

    def waiting(self, ready: int, drones: int) -> None:
        """So many drones are ready."""
        self.doing(f"waiting for drones: {ready} of {drones}")

    def say(self, text: str) -> None:
        """One line above the picture."""
        if screen := self._screen:
            screen.say(text)
        else:
            print(text, file=self._stream, flush=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._opened:
            self._opened.close()
            self._opened = None
