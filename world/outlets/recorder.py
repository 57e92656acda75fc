"""The recorder: every drone's path through one world, one row per tick, for pictures and for looking again."""

from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import TICK_S
from protocols.mission.document import Mission
from world.core import WorldCore
from world.outlets.trajectory import Trajectory

_Kind = TypeVar("_Kind", bound=np.generic)

_FIRST_ROWS = 2200  # a flight of the standard task; longer ones double it


class Recorder:
    """Keeps positions and velocities (T, N, 2) [m, m/s], claimed slots (T, N) and who flies (T, N); ``rows`` is T so far.
    ``mission`` is what is flown.
    """

    def __init__(self, mission: Mission, world: int = 0) -> None:
        """For one world of a core that flies ``mission``; `record` before the first tick and after each."""
        agents = mission.agents
        self._world, self.mission = world, mission
        self.rows = 0
        self._over = False
        self._position = np.empty((_FIRST_ROWS, agents, 2))
        self._velocity = np.empty((_FIRST_ROWS, agents, 2))
        self._slot = np.empty((_FIRST_ROWS, agents), np.int16)
        self._flying = np.empty((_FIRST_ROWS, agents), np.bool_)
        self._obstacles = np.empty((0, 3))
        self._goal_x = mission.goal_x_m

    def record(self, core: WorldCore) -> None:
        """Keep the state as it is now, if the flight is not over: what follows its decision is no part of it."""
        if self._over:
            return
        self._over = bool(core.decided[self._world])
        if self.rows == 0:
            self._obstacles = core.obstacles[self._world, : core.obstacle_count[self._world]].copy()
            self._goal_x = float(core.goal_x[self._world])
        if self.rows == len(self._position):
            self._position, self._velocity = _double(self._position), _double(self._velocity)
            self._slot, self._flying = _double(self._slot), _double(self._flying)
        row, world = self.rows, self._world
        self.mission = core.missions[world]  # hands may have been laid on it
        self._position[row], self._velocity[row] = core.position[world], core.velocity[world]
        self._slot[row], self._flying[row] = core.claim[world], core.flying[world]
        self.rows += 1

    @property
    def trajectory(self) -> Trajectory:
        """All rows kept so far."""
        kept = slice(self.rows)
        return Trajectory(
            self._position[kept], self._velocity[kept], self._slot[kept], self._flying[kept], self._obstacles,
            self._goal_x, TICK_S,
        )  # fmt: skip

    def save(self, path: Path) -> None:
        """Write all rows to an ``.npz`` file; the file is complete or it is not there.

        Raises:
            protocols.whole_file.WriteError: it cannot be written.
        """
        self.trajectory.save(path)


def _double(rows: NDArray[_Kind]) -> NDArray[_Kind]:
    return np.concatenate([rows, np.empty_like(rows)])
