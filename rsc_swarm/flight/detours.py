"""Detours, as one sees them from outside: what agent/control/detour.py does, told from every drone's path.

A drone that obstacles have stopped on the way to its slot flies around them. It is on that detour until it is near its slot
again with nothing in between.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.control.detour import STALLED_TICKS
from protocols.mission.document import Mission
from world.outlets.trajectory import Trajectory

_CLOSING_MPS, _FAR_M, _HOME_M = 1.0, 2.0, 4.0  # as there
_KEPT_M = 0.8  # from surfaces, on the way


class Detour(NamedTuple):
    """A drone's way around an obstacle, in ticks; until: None if it was not back at the end."""

    tick: int
    agent: int
    obstacle: int
    until: int | None


def slot_errors(path: Trajectory, mission: Mission) -> NDArray[np.float64]:
    """(T, N, 2) from every drone to the place of its slot, m."""
    target = mission.target.speed_mps * path.tick_s * np.arange(len(path.slots), dtype=np.float64)
    places = mission.layout.offsets[path.slots]
    places[:, :, 0] += target[:, None]
    return np.asarray(places - path.positions)


def detours(path: Trajectory, mission: Mission) -> list[Detour]:
    """All detours of a flight, in the order in which they begin."""
    if not (mission.detour and len(path.obstacles)):
        return []
    error = slot_errors(path, mission)
    far = np.linalg.norm(error, axis=2)
    stalls = path.flying & (far >= _FAR_M) & (np.sum(path.velocities * error, axis=2) <= _CLOSING_MPS * far)
    return sorted(
        detour
        for agent in range(far.shape[1])
        for detour in _of_one(
            agent, stalls[:, agent], far[:, agent], partial(_in_between, path, error, agent)
        )
    )


def _of_one(
    agent: int, stalls: NDArray[np.bool_], far: NDArray[np.float64], in_between: Callable[[int], int | None]
) -> Iterator[Detour]:
    """The detours of one drone; stalls, far: (T,) as in `detours`."""
    stalled, begun = 0, None
    for tick in range(len(far)) if stalls.sum() > STALLED_TICKS else ():
        if begun is not None:
            if far[tick] < _HOME_M and in_between(tick) is None:
                yield Detour(*begun, tick)
                begun, stalled = None, 0
            continue
        stalled = stalled + 1 if stalls[tick] else 0
        if stalled > STALLED_TICKS:
            stalled = 0
            obstacle = in_between(tick)
            begun = None if obstacle is None else (tick, agent, obstacle)
    if begun is not None:
        yield Detour(*begun, None)


def _in_between(path: Trajectory, error: NDArray[np.float64], agent: int, tick: int) -> int | None:
    """The nearest obstacle on the straight way from a drone to its slot; None: the way is free. An obstacle near which the drone
    or its slot is has to be passed no farther away than that."""
    way, discs = error[tick, agent], path.obstacles
    centre = discs[:, :2] - path.positions[tick, agent]
    share = np.clip(centre @ way / max(float(way @ way), 1e-12), 0.0, 1.0)
    miss = np.linalg.norm(centre - share[:, None] * way, axis=1)
    ends = np.minimum(np.linalg.norm(centre, axis=1), np.linalg.norm(centre - way, axis=1))
    met = np.flatnonzero(miss < np.minimum(discs[:, 2] + _KEPT_M, ends - 1e-3))
    return int(met[np.argmin(np.linalg.norm(centre[met], axis=1))]) if len(met) else None
