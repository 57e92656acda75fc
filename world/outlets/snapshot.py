"""A picture of a flight at one moment, for people: what the live view shows and what a log line says."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from protocols.dynamics import TICK_S
from protocols.wire.status import AgentStatus, all_swaps
from world.core import WorldCore
from world.medium.medium import TALLY


@dataclass(frozen=True)
class AgentRow:
    """One drone in the live view. Place in the mission's frame and nearest distance in metres, speed in m/s, edge error relative;
    heard: neighbours.
    """

    agent: int
    state: str  # "flying", "frozen" or "lost"
    slot: int
    x_m: float
    y_m: float
    speed_mps: float
    nearest_m: float
    edge_error: float
    heard: int
    rejected: int


@dataclass(frozen=True)
class Snapshot:
    """One moment of one flight. discs: obstacles, x, y and radius, m. goal_x_m: the goal line. depth_m: of the formation, front
    to rear."""

    tick: int
    time_s: float
    real_time_factor: float
    deadline_misses: int
    agents: tuple[AgentRow, ...]
    obstacles_passed: int
    obstacles: int
    discs: tuple[tuple[float, float, float], ...]
    goal_x_m: float
    depth_m: float
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
    places = core.position[world].tolist()
    rows = []
    for agent in range(core.shape[1]):
        flying, responsive = bool(core.flying[world, agent]), bool(core.responsive[world, agent])
        status = statuses.get(agent)
        rows.append(
            AgentRow(
                agent=agent,
                state="lost" if not flying else "flying" if responsive else "frozen",
                slot=int(core.claim[world, agent]),
                x_m=places[agent][0],
                y_m=places[agent][1],
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
        discs=tuple((x, y, radius) for x, y, radius in discs.tolist()),
        goal_x_m=float(core.goal_x[world]),
        depth_m=float(np.ptp(core.layout.offsets[:, 0])),
        frames=dict(zip(TALLY, (int(number) for number in core.tally[world]), strict=True)),
        swaps=all_swaps(statuses.values()),
    )
