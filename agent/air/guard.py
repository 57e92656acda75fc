"""The guard: may a drone go on? A pure function of what is known of it and around it, asked every tick of a flight.

    kill   it has turned over
    land   far out of the fence; its position, its clock or the operator long lost; battery low for longer than it sags; tilted
    hold   out of the fence, or about to be; its position old, or moved at once; its clock off; fewer than half of the others
           heard; the operator not heard; about to hit something in spite of the safety filter; asked to fly where it is not

The strongest wins, and all reasons are told. Limits are the fleet file's (protocols.fleet.document.Guard).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from enum import IntEnum
from typing import NamedTuple

from agent.air.vehicle import Setpoint, State, Vector
from protocols.fleet.document import Fence, Guard
from protocols.fleet.plan import Disc, Plan

_ABOVE_M = 0.5  # who is so much higher or lower is not in the way
_FASTER = 1.5  # than its limit: no setpoint asks for that


class Action(IntEnum):
    """What is to be done, the stronger the larger."""

    PASS = 0
    HOLD = 1
    LAND = 2
    KILL = 3


class Verdict(NamedTuple):
    """What is to be done, and why; no reasons where it may go on."""

    action: Action
    reasons: tuple[str, ...]


class Mover(NamedTuple):
    """Another drone as last heard, moved on to now: position [m] and velocity [m/s] in the room."""

    number: int
    p: Vector
    v: Vector


class Situation(NamedTuple):
    """All that the guard looks at.

    jump_m: how far its position has moved at once. setpoint: what it is about to be told; None: nothing. movers: the drones
    that fly. obstacles: that are known. peers_s, operator_s: since half of the others, and the operator, were heard; None: there
    are none to hear. clock_s: this clock minus the median of the others; None: unknown. low_s: for how long its battery has been
    below what makes it land; 0: it is not.
    """

    state: State
    jump_m: float
    setpoint: Setpoint | None
    movers: tuple[Mover, ...]
    obstacles: Sequence[Disc]
    peers_s: float | None
    operator_s: float | None
    clock_s: float | None
    low_s: float = 0.0


class Bounds(NamedTuple):
    """By what it judges, in the room. limit_m: nearer is a collision; of an obstacle, nearer to its surface."""

    fence: Fence
    guard: Guard
    limit_m: float
    speed_mps: float
    acceleration_mps2: float


def bounds_of(plan: Plan) -> Bounds:
    """What a plan says of them."""
    fleet = plan.fleet
    return Bounds(fleet.fence, fleet.guard, plan.limit_m, plan.speed_mps, plan.acceleration_mps2)


Finding = tuple[Action, str]


def judge(seen: Situation, bounds: Bounds) -> Verdict:
    """What is to be done now."""
    findings = [finding for rule in _RULES for finding in rule(seen, bounds)]
    action = max((action for action, _ in findings), default=Action.PASS)
    return Verdict(action, tuple(reason for _, reason in findings))


def _graded(value: float, hold: float, land: float, reason: str) -> Iterator[Finding]:
    if value > hold:
        yield (Action.LAND if value > land else Action.HOLD), reason


def _fence(seen: Situation, bounds: Bounds) -> Iterator[Finding]:
    state, fence = seen.state, bounds.fence
    sides = (fence.x_m, fence.y_m, fence.z_m)
    out = max(max(low - at, at - high) for at, (low, high) in zip(state.p, sides, strict=True))
    if out > 0.0:
        yield from _graded(out, 0.0, bounds.guard.fence_land_m, f"{out:.2f} m out of the fence")
        return
    ahead = bounds.guard.reaction_s + math.hypot(*state.v) / (2 * bounds.acceleration_mps2)
    stops = [at + speed * ahead for at, speed in zip(state.p[:2], state.v[:2], strict=True)]
    if any(not low <= at <= high for at, (low, high) in zip(stops, sides, strict=False)):
        yield Action.HOLD, "the fence is ahead"


def _position(seen: Situation, bounds: Bounds) -> Iterator[Finding]:
    guard, age = bounds.guard, seen.state.age_s
    yield from _graded(
        age, guard.position_hold_s, guard.position_land_s, f"position {min(age, 999.0):.2f} s old"
    )
    if seen.jump_m > guard.jump_m:
        yield Action.HOLD, f"position jumped {seen.jump_m:.2f} m"


def _clock(seen: Situation, bounds: Bounds) -> Iterator[Finding]:
    guard = bounds.guard
    if seen.clock_s is not None:
        off = 1000 * abs(seen.clock_s)
        yield from _graded(off, guard.clock_hold_ms, guard.clock_land_ms, f"clock off by {off:.0f} ms")


def _others(seen: Situation, bounds: Bounds) -> Iterator[Finding]:
    guard = bounds.guard
    if seen.peers_s is not None and seen.peers_s > guard.peers_hold_s:
        yield Action.HOLD, f"too few drones heard for {seen.peers_s:.1f} s"
    if seen.operator_s is not None:
        yield from _graded(
            seen.operator_s,
            guard.operator_hold_s,
            guard.operator_land_s,
            f"operator not heard for {seen.operator_s:.1f} s",
        )


def _vehicle(seen: Situation, bounds: Bounds) -> Iterator[Finding]:
    state, guard = seen.state, bounds.guard
    if seen.low_s > guard.battery_land_s:
        yield Action.LAND, f"battery at {100 * state.battery:.0f} % for {seen.low_s:.1f} s"
    tilt = math.degrees(state.tilt)
    if tilt > guard.tilt_kill_deg:
        yield Action.KILL, f"turned over ({tilt:.0f} degrees)"
    elif tilt > guard.tilt_land_deg:
        yield Action.LAND, f"tilted by {tilt:.0f} degrees"


def _collision(seen: Situation, bounds: Bounds) -> Iterator[Finding]:
    """What cannot be missed but by braking with all it has, now."""
    (x, y, z), (vx, vy, _) = seen.state.p, seen.state.v
    for mover in seen.movers:
        if abs(mover.p[2] - z) < _ABOVE_M and _unavoidable(
            (mover.p[0] - x, mover.p[1] - y), (mover.v[0] - vx, mover.v[1] - vy), bounds.limit_m, bounds
        ):
            yield Action.HOLD, f"about to hit drone {mover.number}"
    for number, (ox, oy, radius) in enumerate(seen.obstacles):
        if _unavoidable((ox - x, oy - y), (-vx, -vy), radius + bounds.limit_m, bounds):
            yield Action.HOLD, f"about to hit obstacle {number}"


def _unavoidable(r: tuple[float, float], v: tuple[float, float], reach: float, bounds: Bounds) -> bool:
    """Whether what is at ``r`` and moves by ``v``, both relative, comes nearer than ``reach`` before one can stop."""
    distance, speed = math.hypot(*r), math.hypot(*v)
    closing = -(r[0] * v[0] + r[1] * v[1]) / max(distance, 1e-9)
    if closing <= 0.0 or speed < 1e-6:
        return False
    when = closing * distance / speed**2
    miss = math.hypot(r[0] + when * v[0], r[1] + when * v[1])
    braking = closing * bounds.guard.reaction_s + closing**2 / (2 * bounds.acceleration_mps2)
    return miss < reach and distance - reach < braking


def _setpoint(seen: Situation, bounds: Bounds) -> Iterator[Finding]:
    if seen.setpoint is None:
        return
    away = math.dist(seen.setpoint.p, seen.state.p)
    if not away <= bounds.guard.setpoint_m:  # nor if it is no number
        yield Action.HOLD, f"setpoint {away:.2f} m away"
    fast = math.hypot(*seen.setpoint.v[:2])
    if not fast <= _FASTER * bounds.speed_mps:
        yield Action.HOLD, f"setpoint of {fast:.2f} m/s"


_RULES: tuple[Callable[[Situation, Bounds], Iterator[Finding]], ...] = (
    _fence,
    _position,
    _clock,
    _others,
    _vehicle,
    _collision,
    _setpoint,
)
