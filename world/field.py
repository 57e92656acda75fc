"""The field of a flight: obstacles from the map seed, starting places and slots from the start seed."""

import math

import numpy as np
from numpy.typing import NDArray

from protocols.arithmetic import cosine, sine
from protocols.dynamics import Vector
from protocols.errors import SwarmError
from protocols.kernels import kernel
from protocols.mission.document import Mission

_MAP, _START, _SLOTS = 1, 2, 3  # each kind of draw has a stream of its own
_TRIES = 100_000


class FieldError(SwarmError, RuntimeError):
    """There is no room to start; the message says what to change."""


def _generator(seed: int, stream: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(key=[seed, stream]))


def draw_obstacles(mission: Mission) -> NDArray[np.float64]:
    """The obstacles (K, 3): centre x, y and radius, metres. They may overlap."""
    spec = mission.obstacles
    if spec.discs is not None:
        return np.array(spec.discs, dtype=np.float64).reshape(-1, 3)
    draw = _generator(mission.map_seed, _MAP)
    count = int(draw.integers(spec.count[0], spec.count[1] + 1))
    low, high = np.array([spec.x_m, spec.y_m, spec.radius_m]).T
    share = draw.random((count, 3))  # numpy's `uniform` may be compiled to round otherwise: with FMA
    discs: NDArray[np.float64] = low + (high - low) * share
    return discs


def goal_x(mission: Mission, obstacles: NDArray[np.float64]) -> float:
    """The line [m] that every drone must have passed: the mission's, or the far end of the last obstacle."""
    ends: list[float] = (obstacles[:, 0] + obstacles[:, 2]).tolist()
    return max([mission.goal_x_m, *ends])


def draw_slots(mission: Mission) -> NDArray[np.int16]:
    """(N,) the slot each agent holds at the start: its own number, or any when the start is scrambled."""
    if not mission.start.scrambled:
        return np.arange(mission.agents, dtype=np.int16)
    return _generator(mission.seed, _SLOTS).permutation(mission.agents).astype(np.int16)


def draw_start(mission: Mission, obstacles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 2) metres: agent i starts around pad i, the offset of slot i, clear of all others and of all obstacles.

    Raises:
        FieldError: no free place was found.
    """
    draw = _generator(mission.seed, _START)
    places = np.empty((mission.agents, 2))
    taken: list[list[float]] = obstacles.tolist()
    for agent, (pad_x, pad_y) in enumerate(mission.layout.offsets.tolist()):
        for _ in range(_TRIES):
            radius = mission.start.radius_m * math.sqrt(draw.random())
            aside_x, aside_y = _turned(radius, 2 * math.pi * draw.random())
            x, y = pad_x + aside_x, pad_y + aside_y
            if _is_clear(x, y, taken, mission.start.gap_m):
                places[agent] = x, y
                taken.append([x, y, 0.0])
                break
        else:
            raise FieldError(
                f"agent {agent} finds no free place within start.radius_m = {mission.start.radius_m:g} m of its pad; "
                f"widen it, lower start.gap_m ({mission.start.gap_m:g} m) or move the obstacles"
            )
    return places


@kernel
def _turned(length: float, angle: float) -> Vector:
    """The vector of this length that points in this direction [rad]."""
    return length * cosine(angle), length * sine(angle)


def _is_clear(x: float, y: float, taken: list[list[float]], gap: float) -> bool:
    """Whether a place is so far [m] from every disc (x, y, radius)."""
    return all(math.sqrt((x - a) * (x - a) + (y - b) * (y - b)) - radius >= gap for a, b, radius in taken)
