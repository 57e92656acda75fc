"""One flight in this process, told to whoever watches: what ``rsc-swarm simulate`` runs.

The outcome is the same whatever is watched or recorded, and the same as ``rsc-swarm launch`` has in lockstep.
"""

import time
from collections.abc import Callable

import numpy as np

from protocols.dynamics import TICK_S
from protocols.mission.document import Mission
from rsc_swarm.flight.simulate import Simulation
from rsc_swarm.machine.leaving import leave_when_asked
from world.outcome import Flown
from world.outlets.recorder import Recorder
from world.outlets.snapshot import Snapshot, snapshot

_SHOW_EVERY_S = 1 / 8
_SHOW_TICKS = 200  # and at least this often
_LOOK_EVERY = 5  # ticks between two looks at the wall clock


def fly(
    mission: Mission,
    realtime: bool = False,
    on_snapshot: Callable[[Snapshot], None] | None = None,
    recorder: Recorder | None = None,
) -> Flown:
    """Fly ``mission`` to its end.

    Args:
        realtime: no faster than the wall clock.
        on_snapshot: called about 8 times a second, and once at the end.
        recorder: keeps every drone's path.

    Ctrl-C ends the flight as interrupted; what was flown is told like any other.

    Raises:
        world.field.FieldError, agent.policy.PolicyError: as Simulation.
    """
    simulation = Simulation([mission])
    core, director = simulation.world, simulation.director
    with leave_when_asked() as leave:
        first_tick_at, begin = time.time(), time.perf_counter()
        shown = -np.inf
        if recorder:
            recorder.record(core)
        while core.active[0]:
            if leave.asked:
                director.leave()
            else:
                director.tick()
                if recorder:
                    recorder.record(core)
            if director.clock % _LOOK_EVERY and core.active[0]:
                continue
            now = time.perf_counter() - begin
            if realtime and now < director.clock * TICK_S:
                time.sleep(director.clock * TICK_S - now)
            due = now - shown >= _SHOW_EVERY_S or director.clock % _SHOW_TICKS == 0
            if on_snapshot and (due or not core.active[0]):
                shown = now
                on_snapshot(snapshot(core, dict(simulation.farewell()), director.clock * TICK_S / now))
        flown = director.flown(time.perf_counter() - begin, first_tick_at)
    return flown
