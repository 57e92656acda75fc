"""Nature: how the drones of many worlds move, and what their sensors see. Rows are worlds (E) x agents (N)."""

import math

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import integrate
from protocols.kernels import inlined_kernel, kernel
from protocols.wire.sensed import Sensed


@inlined_kernel
def move_world(
    world: int,
    flying: NDArray[np.bool_],
    position: NDArray[np.float64],
    velocity: NDArray[np.float64],
    command: NDArray[np.float64],
    ability: NDArray[np.float64],
    a_max: float,
    v_max: float,
    dt: float,
) -> None:
    """Integrate every flying drone of one world by one tick, in place; arguments as `move`."""
    for agent in range(flying.shape[1]):
        if not flying[world, agent]:
            continue
        p, v, a, share = (
            position[world, agent],
            velocity[world, agent],
            command[world, agent],
            ability[world, agent],
        )
        p[0], p[1], v[0], v[1] = integrate(
            p[0], p[1], v[0], v[1], a[0], a[1], a_max * share, v_max * share, dt
        )


@kernel
def move(
    active: NDArray[np.bool_],
    flying: NDArray[np.bool_],
    position: NDArray[np.float64],
    velocity: NDArray[np.float64],
    command: NDArray[np.float64],
    ability: NDArray[np.float64],
    a_max: float,
    v_max: float,
    dt: float,
) -> None:
    """Integrate every flying drone by one tick, in place.

    Args:
        active: (E,). flying: (E, N). position [m], velocity [m/s], command [m/s^2]: (E, N, 2).
        ability: (E, N) share of the limits a_max, v_max that the drone has.
    """
    for world in range(flying.shape[0]):
        if active[world]:
            move_world(world, flying, position, velocity, command, ability, a_max, v_max, dt)


@inlined_kernel
def sense_world(
    world: int,
    flying: NDArray[np.bool_],
    position: NDArray[np.float64],
    velocity: NDArray[np.float64],
    obstacle_count: NDArray[np.int64],
    obstacles: NDArray[np.float64],
    reach: float,
    neighbours_sensed: bool,
    sensed: Sensed,
) -> None:
    """What every flying drone of one world senses, arguments as `sense`."""
    agents = flying.shape[1]
    first, limit = world * agents, sensed.near.shape[1]
    for row in range(first, first + agents):
        sensed.near_count[row] = 0
    for agent in range(agents):
        if not flying[world, agent]:
            continue
        row = first + agent
        px, py = position[world, agent, 0], position[world, agent, 1]
        vx, vy = velocity[world, agent, 0], velocity[world, agent, 1]
        motion = sensed.motion[row]
        motion[0], motion[1], motion[2], motion[3] = px, py, vx, vy
        for other in range(agent + 1 if neighbours_sensed else agents, agents):  # each pair once, for both
            dx, dy = position[world, other, 0] - px, position[world, other, 1] - py
            if dx * dx + dy * dy <= reach * reach and flying[world, other]:
                wx, wy = velocity[world, other, 0] - vx, velocity[world, other, 1] - vy
                mine, theirs = sensed.near_count[row], sensed.near_count[first + other]
                if mine < limit:
                    near = sensed.near[row, mine]
                    near[0], near[1], near[2], near[3], near[4] = other, dx, dy, wx, wy
                    sensed.near_count[row] = mine + 1
                if theirs < limit:
                    near = sensed.near[first + other, theirs]
                    near[0], near[1], near[2], near[3], near[4] = agent, -dx, -dy, -wx, -wy
                    sensed.near_count[first + other] = theirs + 1
        count = 0
        for index in range(obstacle_count[world]):
            dx, dy = obstacles[world, index, 0] - px, obstacles[world, index, 1] - py
            radius = obstacles[world, index, 2]
            if math.sqrt(dx * dx + dy * dy) - radius < reach:
                seen = sensed.obstacles[row, count]
                seen[0], seen[1], seen[2] = dx, dy, radius
                count += 1
        sensed.obstacle_count[row] = count


@kernel
def sense(
    active: NDArray[np.bool_],
    flying: NDArray[np.bool_],
    position: NDArray[np.float64],
    velocity: NDArray[np.float64],
    obstacle_count: NDArray[np.int64],
    obstacles: NDArray[np.float64],
    reach: float,
    neighbours_sensed: bool,
    sensed: Sensed,
) -> None:
    """Fill row world * N + agent of ``sensed``: own motion, neighbours and obstacles within ``reach`` metres.

    Args:
        obstacles: (E, MAX_OBSTACLES, 3) centre and radius [m].
    """
    for world in range(flying.shape[0]):
        if active[world]:
            sense_world(
                world, flying, position, velocity, obstacle_count, obstacles, reach, neighbours_sensed, sensed
            )
