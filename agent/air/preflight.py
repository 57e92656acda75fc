"""Preflight: what speaks against arming a drone, and whether all are about to fly the same. Pure."""

import math
from collections.abc import Sequence

from agent.air.vehicle import Mode, State
from protocols.fleet.plan import Plan
from protocols.wire.account import Account

_STANDS_M = 0.3  # no farther from where the plan has it
_LACKING = 0.2  # of its ticks; at 80 a second it flies, but what keeps it from the others may take more


def complaints(
    plan: Plan,
    me: int,
    state: State,
    heard: Sequence[int],
    clock_s: float | None,
    operator: bool,
    lacking: float,
) -> list[str]:
    """What speaks against arming drone ``me``; empty: nothing does.

    Args:
        heard: the drones it hears now. clock_s: its clock minus the median of the others; None: unknown. operator: is heard.
        lacking: the share of its ticks that it missed lately.
    """
    guard, found = plan.fleet.guard, list(state.health)
    if state.mode is not Mode.GROUND:
        found.append(f"the vehicle is not on the ground ({state.mode})")
    if not state.age_s <= guard.position_hold_s:
        found.append(f"its position is {min(state.age_s, 999.0):.1f} s old")
    away = math.dist(state.p[:2], plan.starts[me])
    if not away <= _STANDS_M:
        x, y = plan.starts[me]
        found.append(
            f"it stands {away:.2f} m from its start; move it to ({x:.2f}, {y:.2f}), or change start_m"
        )
    if not abs(state.p[2]) <= _STANDS_M:
        where = "below" if state.p[2] < 0 else "above"
        found.append(
            f"it stands {abs(state.p[2]):.2f} m {where} the room's floor; start it from the floor, or tell what measures its "
            "position where that is"
        )
    if not state.battery >= guard.battery_arm:
        found.append(f"battery at {100 * state.battery:.0f} %; it needs {100 * guard.battery_arm:.0f} %")
    missing = sorted({*range(plan.mission.agents)} - {me, *heard})
    if missing:
        found.append(
            f"it does not hear drone{'s' if len(missing) > 1 else ''} {', '.join(map(str, missing))}"
        )
    if not operator:
        found.append("it does not hear the operator")
    if clock_s is not None and 1000 * abs(clock_s) > guard.clock_hold_ms:
        found.append(f"its clock is off by {1000 * clock_s:.0f} ms; keep it by chrony or PTP")
    if lacking > _LACKING:
        found.append(
            f"it misses {100 * lacking:.0f} % of its ticks: its machine is too busy; end what else runs there (another fleet?)"
        )
    return found


def disagreement(plan: Plan, version: str, account: Account) -> list[str]:
    """What a drone is about to fly that the operator is not."""
    found = []
    for what, theirs, ours in (
        ("version", account.version, version),
        ("mission", account.mission, plan.mission_digest),
        ("fleet file", account.fleet, plan.fleet_digest),
    ):
        if theirs != ours:
            found.append(f"it has another {what} ({theirs}) than the operator ({ours}); give both the same")
    return found
