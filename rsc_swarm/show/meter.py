"""A bar on a terminal, a line now and then elsewhere. Draws without a thread: whoever shows progress may fork."""

import sys
import time

from rich.progress import BarColumn, Progress, TextColumn

from rsc_swarm.show.render import console

_LINE_EVERY_S = 10.0
_DRAW_EVERY_S = 0.25


class Meter:
    """Shows how much of a total is done, with a text that says what."""

    def __init__(self) -> None:
        screen = console(sys.stderr)
        columns = (BarColumn(24), TextColumn("{task.description}"))
        on_terminal = screen.is_terminal
        self._bar = (
            Progress(*columns, console=screen, auto_refresh=False, transient=True) if on_terminal else None
        )
        self._told = time.monotonic()

    def begin(self, text: str, total: float = 1.0) -> None:
        """The work begins now."""
        self._told = time.monotonic()
        if self._bar:
            self._bar.start()
            self._task = self._bar.add_task(text, total=total)
            self._bar.refresh()

    def due(self) -> bool:
        """Whether it is time to draw again."""
        return time.monotonic() - self._told >= (_DRAW_EVERY_S if self._bar else _LINE_EVERY_S)

    def draw(self, done: float, text: str) -> None:
        """So much of the total is done."""
        self._told = time.monotonic()
        if self._bar:
            self._bar.update(self._task, completed=done, description=text)
            self._bar.refresh()
        else:
            print(text, file=sys.stderr, flush=True)

    def close(self) -> None:
        """Take the bar off the screen."""
        if self._bar:
            self._bar.stop()
