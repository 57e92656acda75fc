"""What a mission says goes wrong: which faults are due, and what they do to the drones of a world."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.mission.document import Mission, parse_mission
from protocols.mission.fault import Fault

EVERYONE = 0  # radio group while the swarm is not parted


class Condition(NamedTuple):
    """How the drones of E worlds are, (E, N) each.

    flying: in the air. responsive: senses, hears and answers. ability: share of its acceleration that a drone has.
    group: only drones of the same radio group hear each other. loss: (E,) share of frames that the radio loses independently.
    lies: what those say that lie (protocols.wire.lies), by row world * N + agent.
    """

    flying: NDArray[np.bool_]
    responsive: NDArray[np.bool_]
    ability: NDArray[np.float64]
    group: NDArray[np.int16]
    loss: NDArray[np.float64]
    lies: dict[int, str]


def sound(missions: Sequence[Mission]) -> Condition:
    """All drones as they start."""
    shape = (len(missions), missions[0].agents)
    return Condition(
        flying=np.ones(shape, np.bool_),
        responsive=np.ones(shape, np.bool_),
        ability=np.ones(shape),
        group=np.full(shape, EVERYONE, np.int16),
        loss=np.array([mission.radio.loss for mission in missions]),
        lies={},
    )


def with_fault(mission: Mission, fault: Mapping[str, Any]) -> Mission:
    """The mission with one more fault, given by its fields.

    Raises:
        protocols.mission.document.MissionError: it would have no effect, or there is no such fault.
    """
    fields = mission.model_dump(mode="json")
    fields["faults"].append(dict(fault))
    return parse_mission(fields, "by hand")


@dataclass(frozen=True)
class Event:
    """A fault that happens now, with the agents it names."""

    world: int
    fault: Fault
    agents: tuple[int, ...]


def due(
    missions: Sequence[Mission],
    initial_slots: NDArray[np.int16],
    active: NDArray[np.bool_],
    tick: NDArray[np.int64],
    spared: NDArray[np.bool_],
) -> list[Event]:
    """The faults of this tick; one of a slot strikes whoever held it at the start (``initial_slots``: (E, N)), but nobody who
    is ``spared`` (E, N)."""
    events = []
    for world in np.flatnonzero(active).tolist():
        for fault in missions[world].faults:
            if fault.at_tick == tick[world]:
                by_slot = (int(np.flatnonzero(initial_slots[world] == slot)[0]) for slot in fault.slots)
                struck = (agent for agent in (*fault.agents, *by_slot) if not spared[world, agent])
                events.append(Event(world, fault, tuple(struck)))
    return events


def strike(
    event: Event,
    condition: Condition,
    velocity: NDArray[np.float64],
    command: NDArray[np.float64],
) -> None:
    """Do to the drones what the fault says; ``velocity`` and ``command``: (E, N, 2)."""
    world, agents, kind = event.world, list(event.agents), event.fault.kind
    flying, responsive = condition.flying, condition.responsive
    if kind == "kill":
        flying[world, agents] = False
        responsive[world, agents] = False
    elif kind == "freeze":
        responsive[world, agents] = False
        command[world, agents] = 0.0
    elif kind == "thaw":
        responsive[world, agents] = flying[world, agents]  # no thaw revives the dead
    elif kind == "restart":
        responsive[world, agents] = True
        velocity[world, agents] *= flying[world, agents, None]  # the dead rise at rest
        flying[world, agents] = True
    elif kind == "slow":
        condition.ability[world, agents] = event.fault.factor
    elif kind == "recover":
        condition.ability[world, agents] = 1.0
    elif kind == "heal":
        condition.group[world] = EVERYONE
    elif kind == "part":
        condition.group[world] = EVERYONE
        for number, group in enumerate(event.fault.groups, start=1):
            condition.group[world, list(group)] = number
    elif kind == "loss":
        condition.loss[world] = event.fault.loss
    elif kind in ("lie", "truth"):
        for agent in agents:
            row = world * condition.flying.shape[1] + agent
            condition.lies.pop(row, None)
            if event.fault.lie:
                condition.lies[row] = event.fault.lie
