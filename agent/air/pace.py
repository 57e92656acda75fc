"""Whether a drone keeps up with its clock."""

_LATELY_TICKS = 500  # so many are looked back on


class Pace:
    """How many of its ticks a drone misses. lacking: which share of them lately."""

    def __init__(self) -> None:
        self.lacking = 0.0
        self._last: int | None = None

    def tick(self, utc_tick: int) -> None:
        """This one is kept, those since the last one were missed."""
        gap = 0 if self._last is None else max(0, utc_tick - self._last - 1)
        self._last = utc_tick
        self.lacking += (gap / (gap + 1) - self.lacking) * min(1.0, (gap + 1) / _LATELY_TICKS)
