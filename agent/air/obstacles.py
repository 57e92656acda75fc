"""Where obstacles are, in the room: what sources tell, put together. Pure.

A source is whatever finds them: the fleet's map, a world that adds some which nobody can touch, one day a lidar. What is told
with noise, and more than once, is one obstacle: sightings whose centres are a few decimetres apart are averaged, each by how sure
it is.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

from protocols.fleet.plan import ONE_OBSTACLE_M, Disc
from protocols.wire.sensed import MAX_OBSTACLES

_SUREST_M = 1e-3


class Sighting(NamedTuple):
    """An obstacle as a source tells of it: centre and radius [m] in the room. sigma_m: of the noise in them; 0: it is certain."""

    x: float
    y: float
    radius: float
    sigma_m: float = 0.0


class ObstacleSource(Protocol):
    """Something that finds obstacles."""

    def news(self) -> Sequence[Sighting]:
        """What it has found since it was asked last. Never waits."""


class MapSource:
    """Obstacles that are known before the flight."""

    def __init__(self, discs: Sequence[Disc]) -> None:
        self._news: Sequence[Sighting] = [Sighting(*disc) for disc in discs]

    def news(self) -> Sequence[Sighting]:
        news, self._news = self._news, ()
        return news


class Obstacles:
    """What all ``sources`` have found so far. Nothing is forgotten: who has flown past an obstacle may come back.

    Attributes:
        discs: all of them, in the order in which they were found.
    """

    def __init__(self, sources: Sequence[ObstacleSource]) -> None:
        self._sources = sources
        self._weights: list[float] = []
        self.discs: list[Disc] = []

    def look(self) -> None:
        """Ask every source."""
        for source in self._sources:
            for sighting in source.news():
                self._take(sighting)

    def nearest(self, x: float, y: float, reach: float) -> list[Disc]:
        """Those whose surface is no farther than ``reach`` [m] from there, the nearest first, as many as a drone can see."""
        seen = sorted((math.hypot(disc[0] - x, disc[1] - y) - disc[2], disc) for disc in self.discs)
        return [disc for distance, disc in seen if distance <= reach][:MAX_OBSTACLES]

    def _take(self, sighting: Sighting) -> None:
        weight = 1.0 / max(sighting.sigma_m, _SUREST_M) ** 2
        told = sighting[:3]
        away = [math.dist(disc[:2], told[:2]) for disc in self.discs]
        if not away or min(away) > ONE_OBSTACLE_M:
            self.discs.append(told)
            self._weights.append(weight)
            return
        which = away.index(min(away))
        known, total = self.discs[which], self._weights[which] + weight
        share = weight / total
        x, y, radius = (was + share * (now - was) for was, now in zip(known, told, strict=True))
        self.discs[which], self._weights[which] = (x, y, radius), total
