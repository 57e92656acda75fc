"""A flight as a page in a browser draws it: one scene, which stays as it is, and many pictures, one a moment.

A picture goes as bytes, which a browser reads as they stand: little-endian, blocks one after the other.

    uint32              length of the head
    head                JSON, padded with spaces to a multiple of 4
    float32 (N, 11)     a drone each, the columns `COLUMNS`
    float32 (K, P, 2)   where each drone plans to be next [m], NaN for what it does not plan; K = N, or 0 where nobody tells
    int16 (B, 3)        beliefs that differ from what is so: who believes, about whom, which slot
    int16 (L, 3)        links on which something was sent in the last 0.2 s: from, to, and a bit for each fate of a frame there:
                        1 carried, 2 lost, 4 delayed (world.medium.medium.FATES)
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import TICK_S
from protocols.mission.document import Mission
from protocols.slots.written import unpack_all
from protocols.wire.status import AgentStatus, all_swaps
from world.core import WorldCore
from world.medium.medium import TALLY

COLUMNS = (
    "x_m",
    "y_m",
    "vx_mps",
    "vy_mps",
    "slot",
    "state",
    "nearest_m",
    "edge_error",
    "heard",
    "rejected",
    "group",
)
LOST, FROZEN, FLYING = range(3)  #: states
FARTHEST_M = 1e6  #: in place of infinity
_MOST_BELIEFS = 10_000  # of a swarm that is at odds; more would say no more
_RECENT_TICKS = 20
_NO_PLANS = np.empty((0, 0, 2), np.float32)


@dataclass(frozen=True)
class Picture:
    """One moment of one flight.

    drones: (N, 11) float32, per `COLUMNS`. beliefs: (B, 3) int16, who, about whom, which slot. links: (L, 3) int16, from, to,
    fates. frames, swaps: counts so far. plans: (N, P, 2) float32 [m], or (0, P, 2).
    """

    tick: int
    real_time_factor: float
    drones: NDArray[np.float32]
    beliefs: NDArray[np.int16]
    links: NDArray[np.int16]
    frames: Mapping[str, int]
    swaps: Mapping[str, int]
    plans: NDArray[np.float32] = field(default_factory=lambda: _NO_PLANS)

    def packed(self) -> bytes:
        """The bytes for the page."""
        head = {
            "tick": self.tick,
            "factor": round(self.real_time_factor, 3),
            "drones": len(self.drones),
            "beliefs": len(self.beliefs),
            "links": len(self.links),
            "plans": self.plans.shape[:2],
            "frames": dict(self.frames),
            "swaps": dict(self.swaps),
        }
        text = json.dumps(head, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        return b"".join(
            (
                len(text).to_bytes(4, "little"),
                text,
                self.drones.astype("<f4").tobytes(),
                self.plans.astype("<f4").tobytes(),
                self.beliefs.astype("<i2").tobytes(),
                self.links.astype("<i2").tobytes(),
            )
        )


def unpacked(data: bytes) -> Picture:
    """The picture whose bytes these are."""
    length = int.from_bytes(data[:4], "little")
    head = json.loads(data[4 : 4 + length])
    at = 4 + length
    blocks: list[NDArray[Any]] = []
    for kind, shape in (
        ("<f4", (head["drones"], len(COLUMNS))), ("<f4", (*head["plans"], 2)), ("<i2", (head["beliefs"], 3)),
        ("<i2", (head["links"], 3)),
    ):  # fmt: skip
        block = np.frombuffer(data, kind, math.prod(shape), at).reshape(shape)
        at += block.nbytes
        blocks.append(block)
    drones, plans, beliefs, links = blocks
    return Picture(head["tick"], head["factor"], drones, beliefs, links, head["frames"], head["swaps"], plans)


def scene(core: WorldCore, world: int = 0) -> dict[str, Any]:
    """What stays as it is in the flight of one world: the field, the formation and its tree, the limits; plain fields."""
    count = int(core.obstacle_count[world])
    return scene_of(core.missions[world], core.obstacles[world, :count], float(core.goal_x[world]))


def scene_of(mission: Mission, obstacles: NDArray[np.float64], goal_x_m: float) -> dict[str, Any]:
    """As `scene`; obstacles: (M, 3) x, y, radius [m]."""
    return {
        "name": mission.name,
        "agents": mission.agents,
        "policy": mission.policy,
        "map": mission.map_seed,
        "seed": mission.seed,
        "tick_s": TICK_S,
        "ticks": mission.ticks,
        "goal_x_m": goal_x_m,
        "obstacles_m": obstacles.tolist(),
        "parent": mission.layout.parent.tolist(),
        "offsets_m": mission.layout.offsets.tolist(),
        "spacing_m": mission.layout.spacing,
        "edge_tolerance": mission.edge_tolerance,
        "collision_m": mission.limits.collision_m,
        "range_m": mission.radio.range_m,
        "target_mps": mission.target.speed_mps,
        "loss": mission.radio.loss,
    }


def picture(
    core: WorldCore,
    statuses: Mapping[int, AgentStatus],
    real_time_factor: float,
    world: int = 0,
    plans: NDArray[np.float32] | None = None,
) -> Picture:
    """One world as it is now; ``statuses``: the drones' own accounts, by agent number. ``plans``: as Director's."""
    drones = np.empty((core.shape[1], len(COLUMNS)), np.float32)
    flying = core.flying[world]
    drones[:, 0:2], drones[:, 2:4] = core.position[world], core.velocity[world]
    drones[:, 4] = core.claim[world]
    drones[:, 5] = np.where(flying, np.where(core.responsive[world], FLYING, FROZEN), LOST)
    drones[:, 6] = np.minimum(core.nearest[world], FARTHEST_M)
    drones[:, 7] = core.edge_error[world]
    drones[:, 8:10] = 0.0
    if statuses:
        told = [(status.heard, sum(status.rejected)) for status in statuses.values()]
        drones[list(statuses), 8:10] = told
    drones[:, 10] = core.condition.group[world]
    return Picture(
        int(core.tick[world]),
        real_time_factor,
        drones,
        _beliefs(core.claim[world], flying, statuses),
        links_of(core.fates[world], int(core.tick[world])),
        dict(zip(TALLY, core.tally[world].tolist(), strict=True)),
        all_swaps(statuses.values()),
        _NO_PLANS if plans is None else plans,
    )


def _beliefs(
    claim: NDArray[np.int16], flying: NDArray[np.bool_], statuses: Mapping[int, AgentStatus]
) -> NDArray[np.int16]:
    """Where the drones' views of the slots differ from what those in the air claim."""
    who = np.array([agent for agent in statuses if flying[agent]], np.int16)
    if not len(who):
        return np.empty((0, 3), np.int16)
    views = unpack_all([statuses[agent].view for agent in who.tolist()], len(claim))
    row, about = np.nonzero((views != claim) & flying)
    return np.stack([who[row], about, views[row, about]], axis=1)[:_MOST_BELIEFS].astype(np.int16)


def links_of(fates: NDArray[np.int32], tick: int) -> NDArray[np.int16]:
    """What became of the frames on each link in the last 0.2 s, as `Picture.links`; fates: (N, N, 3), or of nobody where they
    are not watched."""
    bits = (fates >= tick - _RECENT_TICKS) @ (1 << np.arange(fates.shape[2]))
    source, destination = np.nonzero(bits)
    return np.stack([source, destination, bits[source, destination]], axis=1).astype(np.int16)
