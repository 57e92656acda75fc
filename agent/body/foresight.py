"""Where a drone will be when the command it is about to give takes effect.

What a drone senses is old when it arrives, and its command is older when it is followed: over a network a round trip lies
between, in which the drone flies by the commands that are under way. It knows them. So it moves what it sensed on by them, and
those around it by their velocity, and decides for the moment at which its command counts (a Smith predictor). Where nothing is
late, nothing is moved.
"""

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import TICK_S
from protocols.wire.sensed import Sensed

_LATELY = 50  # ticks over which the round trip is looked at
_FARTHEST = 50  # ticks; beyond that the world has braked the drone
_KEPT = 128  # commands


class Commands(NamedTuple):
    """The last commands of one drone, by tick % `_KEPT`: (K,) the tick that each answered, and (K, 2) m/s^2. on_time: (1,) how
    many came before the next tick."""

    tick: NDArray[np.int64]
    command: NDArray[np.float64]
    on_time: NDArray[np.int64]


class Foresight:
    """How long one drone's commands take.

    Attributes:
        commands: its last ones; whoever flies the drone may also write them there.
    """

    def __init__(self) -> None:
        self.commands = Commands(np.full(_KEPT, -1), np.zeros((_KEPT, 2)), np.zeros(1, np.int64))
        self._late: deque[int] = deque(maxlen=_LATELY)

    def remember(self, tick: int, ax: float, ay: float) -> None:
        """This was commanded in answer to ``tick``: acceleration [m/s^2]."""
        place = tick % _KEPT
        self.commands.tick[place], self.commands.command[place] = tick, (ax, ay)

    def _commanded(self, tick: int) -> tuple[float, float] | None:
        place = tick % _KEPT
        if tick < 0 or self.commands.tick[place] != tick:
            return None
        ax, ay = self.commands.command[place].tolist()
        return ax, ay

    def move_on(self, tick: int, followed: int, sensed: Sensed) -> None:
        """Make of what was sensed at ``tick``, when the drone flew by its answer to tick ``followed``, what will be so when its
        next answer counts; one row, in place.
        """
        if followed == tick - 1 and not self._late:
            self.commands.on_time[0] += 1
            return
        # Where it is unknown, it flew by what was commanded before this process began, or long ago.
        if self._commanded(followed):
            if not self._late:
                self._late.extend([0] * min(int(self.commands.on_time[0]), _LATELY))
            self._late.append(min(tick - 1 - followed, _FARTHEST))
        ahead = sorted(self._late)[len(self._late) // 2] if self._late else 0
        if not ahead:
            return
        (x, y), (vx, vy) = sensed.position[0].tolist(), sensed.velocity[0].tolist()
        was, command = (x, y, vx, vy), self._commanded(followed) or (0.0, 0.0)
        for answered in range(tick - ahead, tick):
            if answered > followed:
                command = self._commanded(answered) or command
            wx, wy = vx + command[0] * TICK_S, vy + command[1] * TICK_S
            x, y = x + 0.5 * TICK_S * (vx + wx), y + 0.5 * TICK_S * (vy + wy)
            vx, vy = wx, wy
        self._put(sensed, was, (x, y, vx, vy), ahead * TICK_S)

    def _put(self, sensed: Sensed, was: tuple[float, ...], now: tuple[float, ...], ahead_s: float) -> None:
        dx, dy, dvx, dvy = (after - before for before, after in zip(was, now, strict=True))
        sensed.position[0], sensed.velocity[0] = now[:2], now[2:]
        near = sensed.near[0, : sensed.near_count[0]]
        # A neighbour goes on as it flew: its own velocity is mine of then plus what I saw of it.
        near["x"] += (near["vx"] + was[2]) * ahead_s - dx
        near["y"] += (near["vy"] + was[3]) * ahead_s - dy
        near["vx"] -= dvx
        near["vy"] -= dvy
        discs = sensed.obstacles[0, : sensed.obstacle_count[0]]
        discs["x"] -= dx
        discs["y"] -= dy
