"""What the compiled loop of the batch simulation works on: the worlds, the numbers of their mission, and room to work in."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.control.follow import Following
from protocols.kernels import inlined_kernel
from world import referee
from world.plant import Bodies, Ground

PLAN, EXPERT, ANALYTIC = range(3)  # who flies the drones of a world
FLYING, SUCCEEDED, COLLIDED, LATE = range(4)
PAST = 4  # ticks of observations kept, the present one last


class Stage(NamedTuple):
    """E worlds of N drones; arrays as in world.core, and

    pilot: (E,) PLAN, EXPERT or ANALYTIC. ticks: (E,) flown. result: (E,). closest: (E,) smallest distance so far [m].
    formed: (E,) tick at which the formation first stood, -1 before. rested: (E, N) tick from which a drone may swap again.
    swaps: (E,). observation: (PAST, E, N, 18), near: (PAST, E, N, K): the last ticks. target: (E, N, 2), extra: (E, N, 32).
    """

    pilot: NDArray[np.int8]
    ticks: NDArray[np.int64]
    result: NDArray[np.int8]
    flying: NDArray[np.bool_]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    command: NDArray[np.float64]
    ability: NDArray[np.float64]
    by_x: NDArray[np.int64]
    claim: NDArray[np.int16]
    obstacle_count: NDArray[np.int64]
    obstacles: NDArray[np.float64]
    goal_x: NDArray[np.float64]
    findings: referee.Findings
    closest: NDArray[np.float64]
    formed: NDArray[np.int64]
    rested: NDArray[np.int64]
    swaps: NDArray[np.int64]
    observation: NDArray[np.float32]
    near: NDArray[np.int16]
    target: NDArray[np.float32]
    extra: NDArray[np.float32]
    start: NDArray[np.float64]
    displacement: NDArray[np.float32]
    acceleration: NDArray[np.float32]


class Field(NamedTuple):
    """The numbers of a mission that the loop needs.

    ends: an episode ends as a flight does; else when its flyer says so. hears: frames are written and heard. both_rest: after a
    swap, not only who asked for it. papers: the expert is the paper's.
    """

    a_max: float
    v_max: float
    spacing_m: float
    edge_tolerance: float
    collision_m: float
    last_tick: int
    cooldown_ticks: int
    ends: bool
    hears: bool
    both_rest: bool
    papers: bool
    following: Following


class Scratch(NamedTuple):
    """holder: (N,). rel (M, 2), radius (M,), side (M,): all obstacles as one drone sees them."""

    holder: NDArray[np.int64]
    rel: NDArray[np.float64]
    radius: NDArray[np.float64]
    side: NDArray[np.int8]


@inlined_kernel
def bodies_of(stage: Stage) -> Bodies:
    """The drones as nature has them."""
    return Bodies(stage.flying, stage.position, stage.velocity, stage.command, stage.ability, stage.by_x)


@inlined_kernel
def ground_of(stage: Stage) -> Ground:
    """What they fly over."""
    return Ground(stage.goal_x, stage.obstacle_count, stage.obstacles)
