"""The digests of flights: of every tick's state, tick by tick, in the order of the arrays.

The states of some ticks are gathered and then taken in together: that costs less, and comes to the same.
"""

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

_GATHERED = 64  # ticks


class Digests:
    """Of the flights of E worlds, all at the same tick, each until it is closed."""

    def __init__(self, arrays: Sequence[NDArray[Any]]) -> None:
        """``arrays``: (E, ...) contiguous; what they hold then, whenever `take` is called."""
        worlds = len(arrays[0])
        self._sources = [array.reshape(worlds, -1).view(np.uint8) for array in arrays]
        ends = np.cumsum([source.shape[1] for source in self._sources]).tolist()
        self._states = np.empty((worlds, _GATHERED, ends[-1]), np.uint8)
        begins = [0, *ends[:-1]]
        self._places = [self._states[:, :, begin:end] for begin, end in zip(begins, ends, strict=True)]
        self._hashes = [hashlib.blake2b(digest_size=16) for _ in range(worlds)]
        self._open = set(range(worlds))
        self._gathered = 0
        self._hashed = [0] * worlds  # of the ticks gathered

    def take(self) -> None:
        """Take in what is so after this tick."""
        if self._gathered == _GATHERED:
            for world in self._open:
                self._hash(world)
            self._gathered, self._hashed = 0, [0] * len(self._hashed)
        for source, place in zip(self._sources, self._places, strict=True):
            place[:, self._gathered] = source
        self._gathered += 1

    def close(self, world: int) -> None:
        """Whatever comes after changes this world's digest no more."""
        if world in self._open:
            self._hash(world)
            self._open.remove(world)

    def of(self, world: int) -> str:
        """The digest of the flight so far."""
        if world in self._open:
            self._hash(world)
        return self._hashes[world].hexdigest()

    def _hash(self, world: int) -> None:
        self._hashes[world].update(self._states[world, self._hashed[world] : self._gathered].data)
        self._hashed[world] = self._gathered
