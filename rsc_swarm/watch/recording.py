"""What a page can be shown: all pictures of a flight so far, thinned where they are many."""

from bisect import bisect_right

_MOST_BYTES = 64 << 20  # kept; then every other picture goes
_MOST_AT_ONCE = 8 << 20  # sent to one page in one message; then only every so many-th picture, and the newest


class Recording:
    """The pictures of one flight by their ticks, oldest first. Bounded, whatever the flight's length."""

    def __init__(self, most_bytes: int = _MOST_BYTES, most_at_once: int = _MOST_AT_ONCE) -> None:
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
        if self._bytes > self._most_bytes and len(self) > 2:
            self._ticks, self._pictures = self._ticks[-1::-2][::-1], self._pictures[-1::-2][::-1]
            self._bytes = sum(map(len, self._pictures))

    def since(self, tick: int) -> tuple[int, bytes]:
        """The pictures after ``tick``, each after its length (uint32, little-endian), and the tick of the newest.

        Who has missed more than can be sent at once gets every so many-th of them, and always the newest.
        """
        missed = self._pictures[bisect_right(self._ticks, tick) :]
        every = -(-sum(map(len, missed)) // self._most_at_once) or 1
        told = missed[-1::-every][::-1]
        return (self._ticks[-1] if missed else tick), b"".join(
            part for picture in told for part in (len(picture).to_bytes(4, "little"), picture)
        )
