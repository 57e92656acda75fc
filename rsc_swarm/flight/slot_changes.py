"""Who came to which slot, and from whom: read off the slots that drones said they held, tick by tick.

swap       two drones take each other's slots, within `_TOGETHER_S` of each other: the news travels by radio
took over  a drone takes a slot that nobody holds any more: of a dead or silent drone, or of one that moved up itself
moved      any other change: a drone hears of several swaps at once, or begins anew
"""

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np

from world.outlets.trajectory import Trajectory

_TOGETHER_S = 2.0


class SlotChange(NamedTuple):
    """At ``tick`` drones took ``slots``, one each; of: from whom, where it was taken over. ways_m: how far those who swapped
    were from their slots, the two of before and the two of after."""

    tick: int
    kind: Literal["swap", "takeover", "move"]
    agents: tuple[int, ...]
    slots: tuple[int, ...]
    of: int | None = None
    ways_m: tuple[tuple[float, float], tuple[float, float]] = ((0.0, 0.0), (0.0, 0.0))


class _Change(NamedTuple):
    tick: int
    agent: int
    left: int
    took: int


def slot_changes(
    path: Trajectory, slot_error: Callable[[int, int, int], float], silent: Callable[[int, int], bool]
) -> list[SlotChange]:
    """All changes of slots in ``path``, in order.

    Args:
        slot_error: (tick, agent, slot) -> how far the drone is from that slot's place, m.
        silent: (tick, agent) -> whether it is dead or answers nothing.
    """
    open_changes = [
        _Change(tick, agent, int(path.slots[tick, agent]), int(path.slots[tick + 1, agent]))
        for tick, agent in np.argwhere(np.diff(path.slots.astype(np.int64), axis=0)).tolist()
        if path.flying[tick + 1, agent]
    ]
    together, told = round(_TOGETHER_S / path.tick_s), []
    while open_changes:
        change = open_changes.pop(0)
        tick, agent, left, took = change
        partner = next(
            (
                other
                for other in open_changes
                if other.tick <= tick + together
                and (other.left, other.took) == (took, left)
                and other.agent != agent
            ),
            None,
        )
        if partner:
            open_changes.remove(partner)
            pair = agent, partner.agent
            before = slot_error(tick, agent, left), slot_error(tick, partner.agent, took)
            after = slot_error(tick, agent, took), slot_error(tick, partner.agent, left)
            told.append(SlotChange(tick, "swap", pair, (took, left), ways_m=(before, after)))
            continue
        holder = _holder(path, change, silent)
        kind: Literal["takeover", "move"] = "move" if holder is None else "takeover"
        told.append(SlotChange(tick, kind, (agent,), (took,), holder))
    return told


def _holder(path: Trajectory, change: _Change, silent: Callable[[int, int], bool]) -> int | None:
    """Who held the slot that this drone took, and does not any more; None if that is not so."""
    tick, agent, _, took = change
    holders = [other for other in np.flatnonzero(path.slots[tick] == took).tolist() if other != agent]
    for other in holders:
        if silent(tick, other) or path.slots[tick + 1, other] != took:
            return int(other)
    if holders:
        return None
    earlier = path.slots[: tick + 1] == took
    earlier[:, agent] = False
    rows, agents = np.nonzero(earlier)
    return int(agents[-1]) if len(rows) else None
