"""A picture of a flight at one moment, for people: what the live view shows and what a log line says."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from protocols.dynamics import TICK_S
from protocols.wire.status import SWAP_COUNTS, AgentStatus
from world.core import WorldCore
from world.medium.medium import TALLY


@dataclass(frozen=True)
class AgentRow:
    """One drone in the live view. Speed in m/s, nearest distance in metres, edge error relative; heard: neighbours."""

    agent: int
    state: str  # "flying", "frozen" or "lost"
    slot: int
    speed_mps: float
    nearest_m: float
    edge_error: float
    heard: int
    rejected: int


@dataclass(frozen=True)
class Snapshot:
    """One moment of one flight."""

    tick: int
    time_s: float
    real_time_factor: float
    deadline_misses: int
    agents: tuple[AgentRow, ...]
    obstacles_passed: int
    obstacles: int
    frames: Mapping[str, int]
    swaps: Mapping[str, int]


def snapshot(
    core: WorldCore,
    statuses: Mapping[int, AgentStatus],
    real_time_factor: float,
    deadline_misses: int = 0,
    world: int = 0,
) -> Snapshot:
    """The state of one world and the drones' own accounts (by agent number) as a picture."""
    speeds = np.linalg.norm(core.velocity[world], axis=1)
    rows = []
    for agent in range(core.shape[1]):
        flying, responsive = bool(core.flying[world, agent]), bool(core.responsive[world, agent])
        status = statuses.get(agent)
        rows.append(
            AgentRow(
                agent=agent,
                state="lost" if not flying else "flying" if responsive else "frozen",
                slot=int(core.claim[world, agent]),
                speed_mps=float(speeds[agent]),
                nearest_m=float(core.nearest[world, agent]),
                edge_error=float(core.edge_error[world, agent]),
                heard=status.heard if status else 0,
                rejected=sum(status.rejected) if status else 0,
            )
        )
    count = int(core.obstacle_count[world])
    discs = core.obstacles[world, :count]
    rearmost = core.position[world, core.flying[world], 0].min(initial=np.inf)
    tick = int(core.tick[world])
    return Snapshot(
        tick=tick,
        time_s=tick * TICK_S,
        real_time_factor=real_time_factor,
        deadline_misses=deadline_misses,
        agents=tuple(rows),
        obstacles_passed=int(np.sum(discs[:, 0] + discs[:, 2] < rearmost)),
        obstacles=count,
        frames=dict(zip(TALLY, (int(number) for number in core.tally[world]), strict=True)),
        swaps={
            name: sum(status.swaps[index] for status in statuses.values())
            for index, name in enumerate(SWAP_COUNTS)
        },
    )
