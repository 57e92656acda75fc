"""Policy ``cruise``: the smallest useful policy, and the pattern to copy for your own.

It steers to its slot like a damped spring and looks at nobody; only the safety filter keeps it from hitting things.
"""

import numpy as np
from numpy.typing import NDArray

from agent.policy.base import Seen
from protocols.mission.document import Mission


class Cruise:
    """A spring of 1 / s^2 to the slot target, damped by 2 / s on the velocity relative to the target."""

    many_flights = True

    def __init__(self, mission: Mission) -> None:
        self._limit = mission.limits.acceleration_mps2

    def act(self, seen: Seen) -> NDArray[np.float64]:
        """Wanted acceleration (A, 2) m/s^2, each component within the limit."""
        wanted = 1.0 * seen.slot_error + 2.0 * (seen.target_velocity - seen.velocity)
        return np.clip(wanted, -self._limit, self._limit)
