"""What is believed of where another drone is: no more than a drone can do. Pure."""

import math
from typing import NamedTuple

from agent.air.vehicle import Vector
from protocols.fleet.plan import Plan

_FASTER = 1.5  # than any is asked to fly, and twice as nimble: an autopilot that makes up for something
_NIMBLER = 2.0
_WIND_MPS = 1.0  # may blow away the slowest
_LATE_S = 1.0  # so much of how late it says that something comes is believed


class Reach(NamedTuple):
    """What a drone can do over ground: its speed [m/s] and acceleration [m/s^2]. jump_m: what is measured of its position may."""

    speed_mps: float
    acceleration_mps2: float
    jump_m: float


def reach_of(plan: Plan) -> Reach:
    """Of the drones of a plan."""
    speed = max(_FASTER * plan.speed_mps, _WIND_MPS)
    return Reach(speed, _NIMBLER * plan.acceleration_mps2, plan.fleet.guard.jump_m)


class Leash:
    """One drone's: what is believed of it goes towards what it says, as fast as a drone can. Its height is its own: by that it
    gets in nobody's way.

    doubtful: whether the last that it said was far from what can be.
    """

    def __init__(self, reach: Reach) -> None:
        self._reach = reach
        self._last: tuple[Vector, Vector, float] | None = None
        self.doubtful = False

    def believed(self, p: Vector, v: Vector, said_at: float, now: float) -> tuple[Vector, Vector]:
        """Of a drone that says that it was at ``p`` [m] with ``v`` [m/s] at ``said_at`` [s], and is heard at ``now`` [s]."""
        at, reach = max(said_at, now - _LATE_S), self._reach
        fast = math.hypot(*v[:2])
        v = _towards((0.0, 0.0, v[2]), v, reach.speed_mps)
        there = p
        if self._last is not None:
            p_before, v_before, before = self._last
            at = max(at, before)
            there = _towards(p_before, p, reach.speed_mps * (at - before))
            v = _towards(v_before, v, reach.acceleration_mps2 * (at - before))
        self.doubtful = math.dist(p, there) > reach.jump_m or fast > 2 * reach.speed_mps
        self._last = there, v, at
        return there, v


def _towards(one: Vector, other: Vector, most: float) -> Vector:
    """From ``one`` towards ``other``, over ground no farther than ``most``; at the height of the other."""
    far = math.dist(one[:2], other[:2])
    if far <= most:
        return other
    share = most / far
    return one[0] + share * (other[0] - one[0]), one[1] + share * (other[1] - one[1]), other[2]
