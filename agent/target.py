"""Where the virtual target is: a drone knows it from the mission and the time alone; no sensor tells it."""

from agent.tick_arrays import Work
from protocols.dynamics import target_x
from protocols.kernels import inlined_kernel


@inlined_kernel
def place_target(tick: int, row: int, target_mps: float, work: Work) -> None:
    """Write where the target is at ``tick`` and how fast it flies into one row of ``work``."""
    work.target_position[row, 0], work.target_position[row, 1] = target_x(tick, target_mps), 0.0
    work.target_velocity[row, 0], work.target_velocity[row, 1] = target_mps, 0.0
