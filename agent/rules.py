"""What a mission means to a drone's kernels: numbers in ticks and metres, and the formation as arrays."""

import numpy as np

from agent.control.gains import gains_for, limits_for
from agent.tick_arrays import Rules
from protocols.mission.document import Mission
from protocols.mission.formation import NO_PARENT
from protocols.relative import RadioRules
from protocols.slots import trigger
from protocols.slots.trigger import Shape


def rules_of(mission: Mission) -> Rules:
    """The mission as a drone's kernels need it."""
    return Rules(
        by_sensor=mission.sensing.neighbours == "sensed",
        remember_obstacles=mission.sensing.obstacle_memory,
        chain=mission.aim == "chain",
        detour=mission.detour,
        filtered=mission.safety_filter,
        frame_every=mission.frame_every,
        reach_m=mission.sensing.range_m,
        target_mps=mission.target.speed_mps,
        radio=RadioRules(
            range_m=mission.radio.range_m,
            memory_ticks=mission.memory_ticks,
            max_hops=mission.radio.hops,
            speed_mps=mission.limits.speed_mps,
        ),
        swap=trigger.SwapRules(
            rule=trigger.RULES[mission.swap.rule],
            margin_m=mission.swap.margin_m,
            connected=mission.swap.connected,
            silent_ticks=mission.silent_ticks,
        ),
        gains=gains_for(mission.limits.collision_m),
        limits=limits_for(mission.limits.acceleration_mps2, mission.limits.collision_m),
    )


def shape_of(mission: Mission) -> Shape:
    """The mission's formation as arrays."""
    parent = mission.layout.parent
    depth = np.zeros(len(parent), np.int64)
    for slot in range(len(parent)):
        above = parent[slot]
        while above != NO_PARENT:
            depth[slot] += 1
            above = parent[above]
    return Shape(mission.layout.offsets, parent, depth)
