"""One flight in this process, told to whoever watches: what ``rsc-swarm simulate`` runs.

The outcome is the same whatever is watched or recorded, and the same as ``rsc-swarm launch`` has in lockstep.
"""

import gc
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from agent.policy.base import PolicyError
from protocols.dynamics import TICK_S
from protocols.mission.document import Mission
from rsc_swarm.flight.drones_apart import flown_by
from rsc_swarm.flight.simulate import Simulation
from rsc_swarm.machine.leaving import leave_when_asked
from world.outcome import Flown
from world.outlets.onlooker import Nobody, Onlooker
from world.outlets.recorder import Recorder
from world.outlets.snapshot import Snapshot, snapshot

_SHOW_EVERY_S = 1 / 8
_SHOW_TICKS = 200  # and at least this often
_LOOK_EVERY = 5  # ticks between two looks at the wall clock
_COLLECT_AFTER = 100_000  # objects more; a tick leaves no cycles behind, and looking for some costs a crowd a tenth of its flight


def fly(
    mission: Mission,
    realtime: bool = False,
    on_snapshot: Callable[[Snapshot], None] | None = None,
    recorder: Recorder | None = None,
    went_wrong: Callable[[PolicyError], None] | None = None,
    onlooker: Onlooker | None = None,
) -> Flown:
    """Fly ``mission`` to its end.

    Ctrl-C ends the flight as interrupted; what was flown is told like any other, if anything was. A policy that then does not
    return is stopped.

    Args:
        realtime: no faster than the wall clock.
        on_snapshot: called about 8 times a second, and once at the end.
        recorder: keeps every drone's path.
        went_wrong: told of a policy that went wrong in flight, which then ends as interrupted; left out: that is raised.
        onlooker: looks on, and may lay hands on the flight.

    Raises:
        world.field.FieldError, agent.policy.PolicyError: as Simulation. KeyboardInterrupt: asked to leave before the first tick.
    """
    wrong: PolicyError | None = None
    with (
        leave_when_asked() as leave,
        _rarely_collecting(),
        flown_by(mission, leave, watched=onlooker is not None) as (director, drones),
    ):
        core = director.core
        first_tick_at, begin = time.time(), time.perf_counter()
        shown, took = -np.inf, None
        if recorder:
            recorder.record(core)
        looks_on = onlooker or Nobody()
        while core.active[0]:
            while (wait_s := looks_on.attend(director)) > 0 and not leave.asked:
                time.sleep(wait_s)
                begin += wait_s
            if leave.asked:
                if not director.clock:
                    raise KeyboardInterrupt
                director.leave()
            else:
                try:
                    director.tick()
                except PolicyError as error:
                    wrong = error
                    director.leave()
                if recorder and not wrong:
                    recorder.record(core)
            if took is None and core.decided[0]:
                took = time.perf_counter() - begin
            if director.clock % _LOOK_EVERY and core.active[0]:
                continue
            now = time.perf_counter() - begin
            if realtime and now < director.clock * TICK_S:
                time.sleep(director.clock * TICK_S - now)
            due = now - shown >= _SHOW_EVERY_S or director.clock % _SHOW_TICKS == 0
            if on_snapshot and (due or not core.active[0]):
                shown = now
                on_snapshot(snapshot(core, dict(drones.farewell()), director.clock * TICK_S / now))
        looks_on.attend(director)
        flown = director.flown(took or time.perf_counter() - begin, first_tick_at)
    if wrong:
        if went_wrong is None:
            raise wrong
        went_wrong(wrong)
    return flown


@contextmanager
def _rarely_collecting() -> Iterator[None]:
    """Meanwhile Python looks less often for objects that hold each other."""
    usual = gc.get_threshold()
    gc.set_threshold(max(usual[0], _COLLECT_AFTER) if usual[0] else 0, *usual[1:])
    try:
        yield
    finally:
        gc.set_threshold(*usual)


def fly_in_step(missions: Sequence[Mission], recorders: Sequence[Recorder]) -> list[Flown]:
    """Fly missions that agree in all but seeds and obstacles in step, each to its own end: the flights that `fly` flies.

    Args:
        recorders: one per mission, for its world.

    Raises:
        world.field.FieldError, agent.policy.PolicyError: as Simulation.
    """
    simulation = Simulation(missions, telling=True)
    core, director = simulation.world, simulation.director
    flown: dict[int, Flown] = {}
    took: dict[int, float] = {}  # until it was decided
    first_tick_at, begin = time.time(), time.perf_counter()
    for recorder in recorders:
        recorder.record(core)
    while core.active.any():
        flying = np.flatnonzero(core.active).tolist()
        ended = director.tick()
        for world in flying:
            recorders[world].record(core)
        for world in np.flatnonzero(core.decided).tolist():
            took.setdefault(world, time.perf_counter() - begin)
        for world in ended:
            flown[world] = director.flown(took[world], first_tick_at, world=world)
    return [flown[world] for world in range(len(missions))]
