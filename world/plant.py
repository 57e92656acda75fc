"""Nature: how the drones of many worlds move, and what their sensors see. Rows are worlds (E) x agents (N)."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import Vector, integrate
from protocols.kernels import inlined_kernel, kernel
from protocols.wire.sensed import Sensed
from world.order import put_in_order


class Bodies(NamedTuple):
    """The drones of E worlds.

    flying: (E, N). position [m], velocity [m/s], command [m/s^2]: (E, N, 2). ability: (E, N)
    share of its limits that a drone has. by_x: (E, N) drone numbers (world.order).
    """

    flying: NDArray[np.bool_]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    command: NDArray[np.float64]
    ability: NDArray[np.float64]
    by_x: NDArray[np.int64]


class Ground(NamedTuple):
    """What E worlds hold besides drones: the goal line (E,) [m]; (E,) obstacles and their centres and radii (E, M, 3) [m]."""

    goal_x: NDArray[np.float64]
    obstacle_count: NDArray[np.int64]
    obstacles: NDArray[np.float64]


@inlined_kernel
def move_world(world: int, bodies: Bodies, a_max: float, v_max: float, dt: float) -> None:
    """Integrate every flying drone of one world by one tick, in place; arguments as `move`."""
    for agent in range(bodies.flying.shape[1]):
        if not bodies.flying[world, agent]:
            continue
        p, v, a = bodies.position[world, agent], bodies.velocity[world, agent], bodies.command[world, agent]
        share = bodies.ability[world, agent]
        (p[0], p[1]), (v[0], v[1]) = integrate(
            (p[0], p[1]), (v[0], v[1]), (a[0], a[1]), a_max * share, v_max * share, dt
        )


@kernel
def move(active: NDArray[np.bool_], bodies: Bodies, a_max: float, v_max: float, dt: float) -> None:
    """Integrate every flying drone of the active worlds (E,) by one tick, in place.

    Args:
        a_max [m/s^2], v_max [m/s]: the limits of a drone with full ability. dt: [s].
    """
    for world in range(active.shape[0]):
        if active[world]:
            move_world(world, bodies, a_max, v_max, dt)


@inlined_kernel
def _note(sensed: Sensed, row: int, other: int) -> None:
    """Row ``row`` senses drone ``other``, if there is room for one more or others have higher numbers."""
    near, count = sensed.near, sensed.near_count[row]
    at = count if count < near.shape[1] else count - 1
    if at < count and near[row, at]["number"] < other:
        return
    while at > 0 and near[row, at - 1]["number"] > other:
        near[row, at]["number"] = near[row, at - 1]["number"]
        at -= 1
    near[row, at]["number"] = other
    sensed.near_count[row] = min(count + 1, near.shape[1])


@inlined_kernel
def _note_all(world: int, bodies: Bodies, reach: float, sensed: Sensed) -> None:
    """Whom every drone of one world senses, by rising number; each pair is looked at once."""
    flying, position, by_x = bodies.flying[world], bodies.position[world], bodies.by_x[world]
    first = world * flying.shape[0]
    put_in_order(by_x, position)
    for place in range(flying.shape[0]):
        agent = by_x[place]
        if not flying[agent]:
            continue
        for later in range(place + 1, flying.shape[0]):
            other = by_x[later]
            dx, dy = position[other, 0] - position[agent, 0], position[other, 1] - position[agent, 1]
            if dx * dx > reach * reach:
                break
            if dx * dx + dy * dy <= reach * reach and flying[other]:
                _note(sensed, first + agent, other)
                _note(sensed, first + other, agent)


@inlined_kernel
def _between(vectors: NDArray[np.float64], agent: int, other: int) -> Vector:
    """What lies from one drone to the other; seen from both it is the same, but for the sign, also of nothing."""
    one, two = min(agent, other), max(agent, other)
    x, y = vectors[two, 0] - vectors[one, 0], vectors[two, 1] - vectors[one, 1]
    return (x, y) if agent < other else (-x, -y)


@inlined_kernel
def sense_world(
    world: int, bodies: Bodies, ground: Ground, reach: float, neighbours_sensed: bool, sensed: Sensed
) -> None:
    """What every flying drone of one world senses, arguments as `sense`."""
    flying, position, velocity = bodies.flying, bodies.position, bodies.velocity
    agents = flying.shape[1]
    first = world * agents
    for row in range(first, first + agents):
        sensed.near_count[row] = 0
    if neighbours_sensed:
        _note_all(world, bodies, reach, sensed)
    for agent in range(agents):
        if not flying[world, agent]:
            continue
        row = first + agent
        px, py = position[world, agent, 0], position[world, agent, 1]
        vx, vy = velocity[world, agent, 0], velocity[world, agent, 1]
        sensed.position[row, 0], sensed.position[row, 1] = px, py
        sensed.velocity[row, 0], sensed.velocity[row, 1] = vx, vy
        for index in range(sensed.near_count[row]):
            near = sensed.near[row, index]
            near["x"], near["y"] = _between(position[world], agent, near["number"])
            near["vx"], near["vy"] = _between(velocity[world], agent, near["number"])
        count = 0
        for index in range(ground.obstacle_count[world]):
            disc = ground.obstacles[world, index]
            dx, dy, radius = disc[0] - px, disc[1] - py, disc[2]
            if math.sqrt(dx * dx + dy * dy) - radius < reach:
                seen = sensed.obstacles[row, count]
                seen["x"], seen["y"], seen["radius"] = dx, dy, radius
                count += 1
        sensed.obstacle_count[row] = count


@kernel
def sense(
    active: NDArray[np.bool_],
    bodies: Bodies,
    ground: Ground,
    reach: float,
    neighbours_sensed: bool,
    sensed: Sensed,
) -> None:
    """Fill row world * N + agent of ``sensed``: own motion, neighbours and obstacles within ``reach`` metres."""
    for world in range(active.shape[0]):
        if active[world]:
            sense_world(world, bodies, ground, reach, neighbours_sensed, sensed)
