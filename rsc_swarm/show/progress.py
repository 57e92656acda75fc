"""How much of some work is done and how long the rest will take: a bar on a terminal, a line now and then elsewhere.

Draws without a thread: whoever shows progress may fork.
"""

import sys
import time

from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from rsc_swarm.show.render import console

_LINE_EVERY_S = 10.0
_DRAW_EVERY_S = 0.25
_SPEED_OVER_S = 600.0  # the time left is reckoned from the speed of so long: work comes in bunches


class Meter:
    """Shows how much of a total is done, with a text that says what."""

    def __init__(self) -> None:
        screen = console(sys.stderr)
        self._on_terminal = screen.is_terminal
        self._left = TimeRemainingColumn()
        self._bar = Progress(
            BarColumn(24),
            TextColumn("{task.description}"),
            self._left,
            console=screen,
            auto_refresh=False,
            transient=True,
            speed_estimate_period=_SPEED_OVER_S,
            disable=not self._on_terminal,
        )
        self._told = time.monotonic()

    def begin(self, text: str, total: float = 1.0, done: int = 0) -> None:
        """The work begins now, or goes on after so much of it is ``done``."""
        self._told = time.monotonic()
        self._bar.start()
        self._task = self._bar.add_task(text, total=total, completed=done)
        self._bar.refresh()

    def due(self) -> bool:
        """Whether it is time to draw again."""
        return time.monotonic() - self._told >= (_DRAW_EVERY_S if self._on_terminal else _LINE_EVERY_S)

    def draw(self, done: float, text: str) -> None:
        """So much of the total is done."""
        self._told = time.monotonic()
        self._bar.update(self._task, completed=done, description=text)
        self._bar.refresh()
        if not self._on_terminal:
            task = self._bar.tasks[self._task]
            left = "" if task.time_remaining is None else f", {self._left.render(task)} left"
            print(text + left, file=sys.stderr, flush=True)

    def close(self) -> None:
        """Take the bar off the screen."""
        self._bar.stop()
