"""A policy such as a user would write: nothing of it is known to the project but its address."""

import numpy as np
from numpy.typing import NDArray

from agent.policy import Seen
from protocols.mission.document import Mission


class Homing:
    """Goes straight to its slot, as a well damped spring."""

    def __init__(self, mission: Mission) -> None:
        self.limit = mission.limits.acceleration_mps2

    def act(self, seen: Seen) -> NDArray[np.float64]:
        """Wanted acceleration (A, 2) m/s^2."""
        wanted = 1.5 * seen.slot_error + 2.5 * (seen.target_velocity - seen.velocity)
        return np.clip(wanted, -self.limit, self.limit)


class Mute:
    """Has no act."""

    def __init__(self, mission: Mission) -> None:
        pass


class Choosy:
    """Flies in one kind of mission only."""

    def __init__(self, mission: Mission) -> None:
        raise ValueError(f"made for 9 agents, not {mission.agents}")
