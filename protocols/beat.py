"""A beat by which a wait that knows no limit ends."""

import threading
from collections.abc import Callable


class Beat:
    """While it is open and somebody waits, it calls ``beat`` every ``every_s``, in a thread of its own.

    Attributes:
        waiting: whether somebody waits; they say so themselves.
    """

    def __init__(self, every_s: float, beat: Callable[[], object]) -> None:
        self.waiting = False
        self._every_s, self._beat, self._over = every_s, beat, threading.Event()
        threading.Thread(target=self._go_on, daemon=True).start()

    def close(self) -> None:
        """No more beats, but for one that may be under way."""
        self._over.set()

    def _go_on(self) -> None:
        while not self._over.wait(self._every_s):
            if self.waiting:
                self._beat()
