"""Parts of a flight for tests of single rules: one drone's arrays, empty; what follows from a mission."""

import numpy as np

from agent.memory import Memory, empty_memory
from agent.rules import rules_of, shape_of
from agent.tick_arrays import TickArrays, empty_views, empty_work
from protocols.mission.document import Mission
from protocols.wire.frames import empty_frames
from protocols.wire.sensed import empty_sensed


def empty_parts(mission: Mission, me: int = 0, memory: Memory | None = None) -> TickArrays:
    """Drone ``me`` of a mission's swarm, which has sensed and heard nothing."""
    return TickArrays(
        rules_of(mission),
        shape_of(mission),
        empty_views(1, mission.agents),
        empty_work(np.array([me]))._replace(inbox=np.zeros(1, np.int64)),
        empty_sensed(1),
        empty_frames(1),
        memory or empty_memory(1, mission.agents),
    )


def times_of(mission: Mission) -> tuple[int, ...]:
    """The times that follow from a mission's fields, in ticks."""
    return (
        mission.ticks, mission.frame_every, mission.memory_ticks, mission.answer_ticks, mission.silent_ticks
    )  # fmt: skip
