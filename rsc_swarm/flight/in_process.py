"""One flight in this process, told to whoever watches: what ``rsc-swarm simulate`` runs.

The outcome is the same whatever is watched or recorded, and the same as ``rsc-swarm launch`` has in lockstep.
"""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from protocols.dynamics import TICK_S
from protocols.mission.document import Mission
from protocols.wire.frames import MAX_FRAME_BYTES
from protocols.wire.status import AgentStatus
from rsc_swarm.flight.simulate import Simulation
from world.medium.medium import TALLY
from world.outlets.recorder import Recorder
from world.outlets.snapshot import Snapshot, snapshot
from world.server.session import Flown

_SHOW_EVERY_S = 1 / 8
_SHOW_TICKS = 200  # and at least this often
_LOOK_EVERY = 5  # ticks between two looks at the wall clock


def statuses(simulation: Simulation, world: int = 0) -> dict[int, AgentStatus]:
    """The drones' own accounts, by agent number."""
    agents = simulation.world.shape[1]
    return {agent: simulation.status(world * agents + agent) for agent in range(agents)}


def fly(
    mission: Mission,
    realtime: bool = False,
    on_snapshot: Callable[[Snapshot], None] | None = None,
    trajectory: Path | None = None,
) -> Flown:
    """Fly ``mission`` to its end.

    Args:
        realtime: no faster than the wall clock.
        on_snapshot: called about 8 times a second, and once at the end.
        trajectory: where to save every drone's path, also when the flight is interrupted.

    Raises:
        world.field.FieldError, agent.policy.PolicyError: as Simulation.
    """
    simulation = Simulation([mission])
    core = simulation.world
    recorder = Recorder(mission) if trajectory else None
    sizes = np.zeros(MAX_FRAME_BYTES + 1, np.int64)
    first_tick_at, begin = time.time(), time.perf_counter()
    shown = -np.inf
    try:
        while core.active[0]:
            if recorder:
                recorder.record(core)
            simulation.tick()
            sizes += np.bincount(np.minimum(simulation.frame_bytes, MAX_FRAME_BYTES), minlength=len(sizes))
            if simulation.clock % _LOOK_EVERY and core.active[0]:
                continue
            now = time.perf_counter() - begin
            if realtime and now < simulation.clock * TICK_S:
                time.sleep(simulation.clock * TICK_S - now)
            due = now - shown >= _SHOW_EVERY_S or simulation.clock % _SHOW_TICKS == 0
            if on_snapshot and (due or not core.active[0]):
                shown = now
                on_snapshot(snapshot(core, statuses(simulation), simulation.clock * TICK_S / now))
    finally:
        if recorder and trajectory:
            recorder.record(core)
            recorder.save(trajectory)
    outcome = core.outcomes[0]
    assert outcome is not None
    wall = time.perf_counter() - begin
    return Flown(
        outcome=outcome,
        tally=dict(zip(TALLY, (int(number) for number in core.tally[0]), strict=True)),
        statuses=statuses(simulation),
        watched=simulation.watches[0].result(),
        wall_s=wall,
        real_time_factor=simulation.clock * TICK_S / wall,
        deadline_misses=0,
        median_frame_bytes=_median(sizes),
        message_bytes=(0.0, 0.0),
        first_tick_at=first_tick_at,
    )


def _median(counts: np.ndarray) -> float:
    """The median of sizes given as counts per size; size 0 means that nothing was sent."""
    counts = counts.copy()
    counts[0] = 0
    total = int(counts.sum())
    return float(np.searchsorted(np.cumsum(counts), (total + 1) // 2)) if total else 0.0
