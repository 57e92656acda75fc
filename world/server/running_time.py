"""Time that stands still while this process does: while it is stopped, or waits for a processor."""

import time
from collections.abc import Callable

GAP_S = 0.5  # between two looks; what is more was a pause


class RunningTime:
    """Seconds since it was made in which this process ran. Only right if looked at more often than every `GAP_S`."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._last, self._ran = clock, clock(), 0.0

    def now(self) -> float:
        last, self._last = self._last, self._clock()
        self._ran += min(self._last - last, GAP_S)
        return self._ran
