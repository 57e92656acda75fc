# homing.py
import numpy as np

from agent.policy import Seen
from protocols.mission.document import Mission


class Homing:
    def __init__(self, mission: Mission) -> None:
        self.limit = mission.limits.acceleration_mps2

    def act(self, seen: Seen) -> np.ndarray:
        wanted = 1.5 * seen.slot_error + 2.5 * (seen.target_velocity - seen.velocity)
        return np.clip(wanted, -self.limit, self.limit)
