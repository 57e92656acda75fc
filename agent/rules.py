"""What a mission means to a drone's kernels: numbers in ticks and metres, and the formation as arrays."""

import numpy as np

from agent.control.gains import gains_for, limits_for
from agent.tick_arrays import Rules, Shape
from protocols.mission.document import Mission
from protocols.mission.formation import NO_PARENT
from protocols.slots import trigger


def rules_of(mission: Mission) -> Rules:
    """The mission as a drone's kernels need it."""
    return Rules(
        by_sensor=mission.sensing.neighbours == "sensed",
        remember_obstacles=mission.sensing.obstacle_memory,
        chain=mission.aim == "chain",
        detour=mission.detour,
        filtered=mission.safety_filter,
        connected=mission.swap.connected,
        swap_rule=trigger.RULES[mission.swap.rule],
        memory_ticks=mission.memory_ticks,
        silent_ticks=mission.silent_ticks,
        max_hops=mission.radio.hops,
        frame_every=mission.frame_every,
        range_m=mission.radio.range_m,
        reach_m=mission.sensing.range_m,
        margin_m=mission.swap.margin_m,
        target_mps=mission.target.speed_mps,
        gains=gains_for(mission.limits.collision_m),
        limits=limits_for(mission.limits.acceleration_mps2, mission.limits.collision_m),
    )


def shape_of(mission: Mission) -> Shape:
    """The mission's formation as arrays."""
    parent = mission.plan.parent
    depth = np.zeros(len(parent), np.int64)
    for slot in range(len(parent)):
        above = parent[slot]
        while above != NO_PARENT:
            depth[slot] += 1
            above = parent[above]
    return Shape(mission.plan.offsets, parent, depth)
