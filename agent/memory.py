"""What a drone remembers, as rows of arrays (one row per hosted drone)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.control.surroundings import Discs, Neighbours
from protocols.dynamics import Vector
from protocols.kernels import inlined_kernel
from protocols.relative import MAX_HOPS, NEVER, UNKNOWN, Within
from protocols.wire.frames import MAX_KNOWN, OBSERVATION_SIZE, RELAYED
from protocols.wire.sensed import MAX_NEAR, MAX_OBSTACLES


class Memory(NamedTuple):
    """Shapes: A hosted drones, N drones of the swarm, K = MAX_NEAR, M = MAX_OBSTACLES.

    heard_*: (A, N, ...) what the last frame of each drone said, and how it had accelerated [m/s^2]; heard_relayed only where the
    policy asks for it. news_*: (A, N, ...) the latest p [m] and v [m/s] of each drone by its own word or that of others, and its
    tick (agent.heard); nothing where neighbours are sensed. last_seen: (A, N) tick at which anybody, as far as is known here,
    last heard each drone. hops, rel, freshest, within, within_up_to: multi-hop relative
    positions (protocols.relative). began: (A,) tick from which the drone has listened.
    near_*: neighbours now, relative position and velocity. disc_*: obstacles, centre in the common frame [m], radius [m],
    and the side on which each is being passed. stalled: (A,) ticks for which the drone has not come nearer to its slot.
    way: (A, 3) next corner of its detour [m] and how many are left (agent.control.detour).
    obstacle_rel: disc centres relative to the drone now.
    """

    heard_tick: NDArray[np.int64]
    heard_motion: NDArray[np.float32]
    heard_acceleration: NDArray[np.float64]
    heard_observation: NDArray[np.int16]
    heard_relayed: NDArray[np.int16]
    heard_one_hop: NDArray[np.int64]
    heard_count: NDArray[np.int64]
    heard_known: NDArray[np.uint16]
    heard_displacement: NDArray[np.float32]
    news_tick: NDArray[np.int64]
    news_motion: NDArray[np.float32]
    last_seen: NDArray[np.int64]
    hops: NDArray[np.int64]
    rel: NDArray[np.float64]
    freshest: NDArray[np.int64]
    within: NDArray[np.int64]
    within_up_to: NDArray[np.int64]
    began: NDArray[np.int64]
    near_count: NDArray[np.int64]
    near_id: NDArray[np.int64]
    near_rel: NDArray[np.float64]
    near_vel: NDArray[np.float64]
    disc_count: NDArray[np.int64]
    disc: NDArray[np.float64]
    disc_side: NDArray[np.int8]
    stalled: NDArray[np.int64]
    way: NDArray[np.float64]
    obstacle_rel: NDArray[np.float64]
    obstacle_radius: NDArray[np.float64]


@inlined_kernel
def put_neighbour(memory: Memory, row: int, at: int, number: int, rel: Vector, vel: Vector) -> None:
    """Note drone ``number`` as neighbour ``at`` of one drone: ``rel`` [m] and ``vel`` [m/s], it minus me."""
    memory.near_id[row, at] = number
    memory.near_rel[row, at, 0], memory.near_rel[row, at, 1] = rel
    memory.near_vel[row, at, 0], memory.near_vel[row, at, 1] = vel


@inlined_kernel
def neighbours_of(memory: Memory, row: int) -> Neighbours:
    """One drone's neighbours now, as its controller takes them."""
    return Neighbours(memory.near_count[row], memory.near_rel[row], memory.near_vel[row])


@inlined_kernel
def discs_of(memory: Memory, row: int) -> Discs:
    """The obstacles that one drone knows, as its controller takes them."""
    return Discs(
        memory.disc_count[row], memory.obstacle_rel[row], memory.obstacle_radius[row], memory.disc_side[row]
    )


@inlined_kernel
def within_of(memory: Memory, row: int) -> Within:
    """Whom one drone knows the way to."""
    return Within(memory.within[row], memory.within_up_to[row])


def empty_memory(rows: int, agents: int, relays: bool = False) -> Memory:
    """A memory of nothing; every drone counts as seen at tick 0. ``relays``: there is room for relayed means."""
    return Memory(
        heard_tick=np.full((rows, agents), NEVER),
        heard_motion=np.zeros((rows, agents, 4), np.float32),
        heard_acceleration=np.zeros((rows, agents, 2)),
        heard_observation=np.zeros((rows, agents, OBSERVATION_SIZE), np.int16),
        heard_relayed=np.zeros((rows, agents, RELAYED if relays else 0, OBSERVATION_SIZE), np.int16),
        heard_one_hop=np.zeros((rows, agents), np.int64),
        heard_count=np.zeros((rows, agents), np.int64),
        heard_known=np.zeros((rows, agents, MAX_KNOWN), np.uint16),
        heard_displacement=np.zeros((rows, agents, MAX_KNOWN, 2), np.float32),
        news_tick=np.full((rows, agents), NEVER),
        news_motion=np.zeros((rows, agents, 4), np.float32),
        last_seen=np.zeros((rows, agents), np.int64),
        hops=np.full((rows, agents), UNKNOWN),
        rel=np.zeros((rows, agents, 2)),
        freshest=np.zeros((rows, agents), np.int64),
        within=np.zeros((rows, agents), np.int64),
        within_up_to=np.zeros((rows, MAX_HOPS + 1), np.int64),
        began=np.zeros(rows, np.int64),
        near_count=np.zeros(rows, np.int64),
        near_id=np.zeros((rows, MAX_NEAR), np.int64),
        near_rel=np.zeros((rows, MAX_NEAR, 2)),
        near_vel=np.zeros((rows, MAX_NEAR, 2)),
        disc_count=np.zeros(rows, np.int64),
        disc=np.zeros((rows, MAX_OBSTACLES, 3)),
        disc_side=np.zeros((rows, MAX_OBSTACLES), np.int8),
        stalled=np.zeros(rows, np.int64),
        way=np.zeros((rows, 3)),
        obstacle_rel=np.zeros((rows, MAX_OBSTACLES, 2)),
        obstacle_radius=np.zeros((rows, MAX_OBSTACLES)),
    )


def forget(memory: Memory, row: int, tick: int) -> None:
    """A restarted drone knows nothing; all others count as seen now, so that it does not take them for dead."""
    memory.heard_tick[row] = memory.news_tick[row] = NEVER
    memory.last_seen[row] = memory.began[row] = tick
    memory.disc_count[row] = 0
    memory.stalled[row] = 0
