"""The time of day for who flies by it: UTC as it was on the ground, counted on by a clock that never steps."""

import time


class Utc:
    """UTC in whole microseconds. Should the machine's clock be set in mid-flight, this one goes on as before."""

    def __init__(self) -> None:
        self.set()

    def set(self) -> None:
        """Take the machine's time of day."""
        self._offset_ns = time.time_ns() - time.monotonic_ns()

    def us(self) -> int:
        return (time.monotonic_ns() + self._offset_ns) // 1000
