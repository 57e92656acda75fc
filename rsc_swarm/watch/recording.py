"""What a page can be shown: all pictures of a flight so far, thinned where they are many."""

from bisect import bisect_right

_MOST_BYTES = 64 << 20  # kept; then every other picture goes
_MOST_AT_ONCE = 8 << 20  # sent to one page in one message; then only every so many-th picture, and the newest


class Recording:
    """The pictures of one flight by their ticks, oldest first. Bounded, whatever the flight's length.

    Attributes:
        whole: nothing is thinned; who has missed much is given it piece by piece. For a flight that is over.
    """

    def __init__(self, most_bytes: int = _MOST_BYTES, most_at_once: int = _MOST_AT_ONCE) -> None:
        self.whole = False
        self._most_bytes, self._most_at_once = most_bytes, most_at_once
        self._ticks: list[int] = []
        self._pictures: list[bytes] = []
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._ticks)

    @property
    def newest(self) -> bytes | None:
        """The last picture."""
        return self._pictures[-1] if self._pictures else None

    def add(self, tick: int, picture: bytes) -> None:
        """Keep a picture; one that is not newer than the last is none."""
        if self._ticks and tick <= self._ticks[-1]:
            return
        self._ticks.append(tick)
        self._pictures.append(picture)
        self._bytes += len(picture)
        if self._bytes > self._most_bytes and len(self) > 2 and not self.whole:
            self._ticks, self._pictures = self._ticks[-1::-2][::-1], self._pictures[-1::-2][::-1]
            self._bytes = sum(map(len, self._pictures))

    def since(self, tick: int) -> tuple[int, bytes]:
        """The pictures after ``tick``, each after its length (uint32, little-endian), and the tick of the last of them.

        Who has missed more than can be sent at once gets every so many-th of them, and always the newest.
        """
        first = bisect_right(self._ticks, tick)
        missed = self._pictures[first:]
        every = -(-sum(map(len, missed)) // self._most_at_once) or 1
        told = missed[: -(-len(missed) // every)] if self.whole else missed[-1::-every][::-1]
        last = self._ticks[first + len(told) - 1 if self.whole else -1] if told else tick
        return last, b"".join(
            part for picture in told for part in (len(picture).to_bytes(4, "little"), picture)
        )
