"""What a drone does by itself when no fresh command reaches it in real time: it brakes to a hover, and then holds or lands.

On the air this is the autopilot's part; in a simulated world the world plays the body, so it does it here. A command counts from
the tick that it answers; older than ``failsafe.after_s`` it is no longer followed.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import TICK_S, clip_ball, ticks_of
from protocols.mission.document import Mission

SILENT_S = 30.0  #: a drone that has been silent for longer is lost
_STILL_MPS = 1e-6
_OLDEST = 1000  # ticks; what is older counts as that old among all


class CommandAges(NamedTuple):
    """How old the commands were by which drones flew, or would have flown, had they not braked [s].

    p99_s: of all drones and ticks. longest_s: of each drone. braked_s: time in the failsafe, of each drone. landed: who landed.
    misses: how often, over all drones and ticks, the answer to a tick had not come in time.
    """

    p99_s: float
    longest_s: tuple[float, ...]
    braked_s: tuple[float, ...]
    landed: tuple[int, ...]
    misses: int


class Failsafe:
    """The failsafe of N drones.

    Attributes:
        misses: as `CommandAges` has it, so far. silent: who has been silent for longer than `SILENT_S`, and why that is the end.
    """

    def __init__(self, mission: Mission) -> None:
        agents = mission.agents
        self._after, self._lands = ticks_of(mission.failsafe.after_s), mission.failsafe.then == "land"
        self._a_max = mission.limits.acceleration_mps2
        self._idle, self._excused = np.full(agents, -1), np.full(agents, -1)
        self._counts = np.zeros(_OLDEST + 1, np.int64)  # of commands of each age in ticks
        self._longest, self._braked = np.zeros(agents, np.int64), np.zeros(agents, np.int64)
        self._landed: list[int] = []
        self.misses, self.silent = 0, list[tuple[int, str]]()

    def replace_old(
        self, tick: int, answered: NDArray[np.int64], awake: NDArray[np.bool_], velocity: NDArray[np.float64],
        command: NDArray[np.float64],
    ) -> list[int]:  # fmt: skip
        """Replace those of the commands that are too old; return who lands now.

        Args:
            answered: (N,) the tick of each drone's last answer. awake: (N,) who is to answer: others are silent by the mission.
            velocity: (N, 2) [m/s]. command: (N, 2) [m/s^2], in place.
        """
        self._idle[~awake] = tick
        age = np.where(awake, tick - np.maximum(answered, self._idle), 0)
        self._counts += np.bincount(np.minimum(age[awake], _OLDEST), minlength=len(self._counts))
        self.misses += int((age > 0).sum())
        np.maximum(self._longest, age, out=self._longest)
        silent = np.flatnonzero(np.minimum(age, tick - self._excused) > ticks_of(SILENT_S)).tolist()
        self.silent = [(agent, f"it has not answered for {SILENT_S:g} s") for agent in silent]
        old = np.flatnonzero(age > self._after).tolist()
        self._braked[old] += 1
        for agent in old:
            vx, vy = velocity[agent].tolist()
            command[agent] = clip_ball(-vx / TICK_S, -vy / TICK_S, self._a_max)
        still = [agent for agent in old if np.abs(velocity[agent]).sum() < _STILL_MPS]
        landing = still if self._lands else []
        self._landed += landing
        return landing

    def excuse(self, agent: int, tick: int) -> None:
        """It is known why this drone is silent: how long it is, is counted anew."""
        self._excused[agent] = tick

    def ages(self) -> CommandAges:
        """The figures of the flight so far."""
        told = np.cumsum(self._counts)
        p99 = round(int(np.searchsorted(told, 0.99 * told[-1])) * TICK_S, 2) if told[-1] else 0.0
        longest, braked = (
            tuple(round(ticks * TICK_S, 2) for ticks in of.tolist()) for of in (self._longest, self._braked)
        )
        return CommandAges(p99, longest, braked, tuple(self._landed), self.misses)
