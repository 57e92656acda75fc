"""A flight flown again, for what nobody wrote down: the radio, what drones believed.

A flight in lockstep repeats bit for bit. Whether it was the same flight, its digest says.
"""

from collections.abc import Iterator

from protocols.errors import SwarmError
from protocols.mission.document import Mission
from rsc_swarm.flight.simulate import Simulation
from world.director import Director


class NotAgain(SwarmError, RuntimeError):
    """It cannot be flown again; one line says why."""


def fly_again(mission: Mission, clock: str, ticks: int, digest: str) -> Iterator[Director]:
    """Fly a flight of so many ticks again: yields who directs it, before the first tick and after each.

    Raises:
        NotAgain: it is another flight, which is known only at its end, or it was flown by the clock.
        world.field.FieldError, agent.policy.PolicyError: it cannot be flown here.
    """
    if clock != "lockstep":
        raise NotAgain("it was flown by the clock")
    simulation = Simulation([mission], watched=True)
    yield simulation.director
    while simulation.clock < ticks and simulation.world.active[0]:
        simulation.tick()
        yield simulation.director
    if simulation.world.outcome(0).digest != digest:
        raise NotAgain("flown again here it is another flight")
