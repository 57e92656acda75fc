"""Drones that fly a policy of somebody's own in a process of its own (rsc_swarm.flight.apart), each tick by request.

The world stays here, and with it all that has been flown.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from protocols.closing import Closing
from protocols.mission.document import Mission
from protocols.wire.status import AgentStatus
from rsc_swarm.flight.apart import Apart, is_own
from rsc_swarm.flight.side_by_side import threads_for
from rsc_swarm.flight.simulate import Simulation
from rsc_swarm.machine.leaving import Leave
from world.core import Answers, Inbox, WorldCore
from world.director import Director, Swarm
from world.faults import Event


@contextmanager
def flown_by(
    mission: Mission, leave: Leave, rehearsal: bool = False, watched: bool = False
) -> Iterator[tuple[Director, Swarm]]:
    """Who flies a mission in this process, with a policy of somebody's own apart; the arguments are those of `Simulation`.

    Raises:
        world.field.FieldError, PolicyError: it cannot be flown.
    """
    if not is_own(mission.policy):
        threads = threads_for(mission.agents)
        simulation = Simulation([mission], rehearsal, watched=watched, threads=threads)
        yield simulation.director, simulation
        return
    world = WorldCore([mission], watched)
    with DronesApart(world, leave, rehearsal) as drones:
        yield Director(world, drones), drones


class DronesApart(Closing, Swarm):
    """The drones of one flight: a swarm (world.director.Swarm)."""

    def __init__(self, world: WorldCore, leave: Leave, rehearsal: bool = False) -> None:
        """The drones of this world's flight, whose policy may be left; rehearsal: as `Simulation`.

        Raises:
            PolicyError: as `Apart`.
        """
        (mission,) = world.missions
        self._world, self._clock = world, 0
        self._apart = Apart(partial(_Followed, mission, rehearsal), mission.policy, leave)

    def strike(self, event: Event) -> None:
        self._apart.call("strike", self._now(), event)

    def struck_off(self, row: int) -> None:
        """It is asked no more, and that is all."""

    def ask(self, tick: int, inbox: Inbox) -> Answers:
        said: Answers = self._apart.call("ask", self._now(), inbox.arrived)
        self._clock = tick + 1
        return said

    def farewell(self) -> list[tuple[int, AgentStatus]]:
        """The last accounts of all drones that fly and answer; of none if their process is gone."""
        if self._apart.ended:
            return []
        said: list[tuple[int, AgentStatus]] = self._apart.call("farewell", self._now())
        return said

    def _now(self) -> "_Now":
        return self._clock, _changing(self._world)

    def close(self) -> None:
        self._apart.close()


_Now = tuple[int, tuple[NDArray[Any], ...]]  # the clock, and what `_changing` says


def _changing(world: WorldCore) -> tuple[NDArray[Any], ...]:
    """All of a world that drones look at and that changes."""
    return (world.flying, world.responsive, world.active, world.inbox_start, *world.sensed)


class _Followed:
    """The other end: a simulation whose world does as it is told."""

    def __init__(self, mission: Mission, rehearsal: bool) -> None:
        self._simulation = Simulation([mission], rehearsal)

    def _follow(self, now: _Now) -> Simulation:
        self._simulation.director.clock, there = now
        for mine, theirs in zip(_changing(self._simulation.world), there, strict=True):
            mine[...] = theirs
        return self._simulation

    def strike(self, now: _Now, event: Event) -> None:
        self._follow(now).strike(event)

    def ask(self, now: _Now, arrived: NDArray[np.int32]) -> Answers:
        simulation = self._follow(now)
        return simulation.ask(simulation.clock, Inbox(simulation.world.inbox_start, arrived))

    def farewell(self, now: _Now) -> list[tuple[int, AgentStatus]]:
        return self._follow(now).farewell()
