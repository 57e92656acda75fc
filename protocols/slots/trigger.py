"""When a swap is worth proposing, and whether it may be: decided by one drone from what it knows.

A swap exchanges the slots of two drones. Two rules can ask for one (mission field ``swap.rule``):

    tree     the paper's: a leader and one of its followers, if both would be closer, by a margin, to the other's target
    contact  any two neighbours. With r the other's position relative to me and D the other's slot relative to mine, the sum
             of squared distances to the two slots falls by exactly -2 r.D: the targets themselves cancel. So the rule is: swap
             when the other is at least ``margin`` metres on the wrong side of me, measured along the line of our slots

Feasibility (``swap.connected``): the drones whose leader or followers change, as the asking drone knows them, must form
one connected piece of the radio graph. The asking drone is the one whose slot is nearer to the root. Among several
candidates the one that gains most is chosen.

A drone silent for everybody for ``silent`` ticks has left its slot: its closest living follower takes it, and so on
down, so that only a leaf stays empty. Only a follower within radio range of the slot's place judges: from farther away, it
may be its own fault that it hears nobody there.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.arithmetic import length
from protocols.dynamics import Vector
from protocols.kernels import allocating_kernel, inlined_kernel
from protocols.mission.formation import NO_PARENT
from protocols.relative import UNKNOWN, RadioRules, Within

OFF, TREE, CONTACT = 0, 1, 2
RULES = {"off": OFF, "tree": TREE, "contact": CONTACT}
NOBODY = -1


class SwapRules(NamedTuple):
    """What a mission's section ``swap`` means: rule: OFF, TREE or CONTACT; margin_m; connected; silent_ticks: patience with a
    drone that nobody hears."""

    rule: int
    margin_m: float
    connected: bool
    silent_ticks: int


class Shape(NamedTuple):
    """The formation: offsets (N, 2) [m], parent (N,), depth (N,) edges up to the root."""

    offsets: NDArray[np.float64]
    parent: NDArray[np.int16]
    depth: NDArray[np.int64]


class Known(NamedTuple):
    """What one drone knows of all N: slot_of, occupant: who holds which slot. heard_tick: of the last frame from each.
    last_seen: tick at which anybody last heard each. hops, rel: how many hops away each is and where, relative to me [m].
    within: the same, for who has few hops."""

    slot_of: NDArray[np.int64]
    occupant: NDArray[np.int64]
    heard_tick: NDArray[np.int64]
    last_seen: NDArray[np.int64]
    hops: NDArray[np.int64]
    rel: NDArray[np.float64]
    within: Within


@inlined_kernel
def tree_gain(ex: float, ey: float, rx: float, ry: float, dx: float, dy: float, margin: float) -> float:
    """The paper's trigger between me, leader, and a follower: metres gained by the two together, or 0 if not triggered.

    (ex, ey): my target minus me. (rx, ry): follower minus me. (dx, dy): its slot minus mine. All in metres.
    """
    mine = length(ex, ey)
    follower_to_mine = length(ex - rx, ey - ry)
    me_to_followers = length(ex + dx, ey + dy)
    followers = length(ex + dx - rx, ey + dy - ry)
    if follower_to_mine + margin < mine and me_to_followers + margin < followers:
        return mine - follower_to_mine + followers - me_to_followers
    return 0.0


@inlined_kernel
def contact_gain(rx: float, ry: float, dx: float, dy: float, margin: float) -> float:
    """Fall in the sum of squared distances to the two slots [m^2], or 0 if the other is not ``margin`` metres wrong."""
    along = rx * dx + ry * dy
    if along < -margin * length(dx, dy):
        return -2.0 * along
    return 0.0


@inlined_kernel
def _is_either(slot: int, one: int, other: int) -> bool:
    """Said in words of Python's own, ``in (one, other)``, it would take a second to compile."""
    return (slot == one) | (slot == other)


@allocating_kernel
def affected_connected(
    slot_a: int,
    slot_b: int,
    parent: NDArray[np.int16],
    occupant: NDArray[np.int64],
    hops: NDArray[np.int64],
    rel: NDArray[np.float64],
    range_m: float,
) -> bool:
    """Whether the holders of both slots, of their parents and of their children form one connected radio graph."""
    agents = parent.shape[0]
    members = np.empty(agents, np.int64)
    count = 0
    for slot in range(agents):
        is_pair = _is_either(slot, slot_a, slot_b)
        is_child = _is_either(parent[slot], slot_a, slot_b)
        is_parent = _is_either(slot, parent[slot_a], parent[slot_b])
        if is_pair or is_child or is_parent:
            if hops[occupant[slot]] == UNKNOWN:
                return False
            members[count] = occupant[slot]
            count += 1
    reached = np.zeros(count, np.bool_)
    reached[0] = True
    found = 1
    for _ in range(count):
        for a in range(count):
            for b in range(count):
                if reached[a] and not reached[b]:
                    dx = rel[members[a], 0] - rel[members[b], 0]
                    dy = rel[members[a], 1] - rel[members[b], 1]
                    if dx * dx + dy * dy <= range_m * range_m:
                        reached[b] = True
                        found += 1
    return found == count


@inlined_kernel
def swap_partner(
    me: int, tick: int, rules: SwapRules, radio: RadioRules, error: Vector, shape: Shape, known: Known
) -> int:
    """The drone I should propose a swap to now, or NOBODY. ``error``: my target minus me [m]."""
    offsets, parent, depth, rel = shape.offsets, shape.parent, shape.depth, known.rel
    mine = known.slot_of[me]
    best, best_gain = NOBODY, 0.0
    for index in range(known.within.up_to[1]):
        other = known.within.number[index]
        if tick - known.heard_tick[other] > radio.memory_ticks:
            continue
        theirs = known.slot_of[other]
        dx, dy = offsets[theirs, 0] - offsets[mine, 0], offsets[theirs, 1] - offsets[mine, 1]
        if rules.rule == TREE:
            gain = (
                tree_gain(error[0], error[1], rel[other, 0], rel[other, 1], dx, dy, rules.margin_m)
                if parent[theirs] == mine
                else 0.0
            )
        else:
            i_ask = depth[mine] < depth[theirs] or (depth[mine] == depth[theirs] and mine < theirs)
            gain = contact_gain(rel[other, 0], rel[other, 1], dx, dy, rules.margin_m) if i_ask else 0.0
        if gain > best_gain and (
            not rules.connected
            or affected_connected(mine, theirs, parent, known.occupant, known.hops, rel, radio.range_m)
        ):
            best, best_gain = other, gain
    return best


@inlined_kernel
def vacancy_to_fill(
    me: int, tick: int, rules: SwapRules, radio: RadioRules, error: Vector, shape: Shape, known: Known
) -> int:
    """The dead drone whose slot is mine to take, or NOBODY: my leader is silent and no living sibling is closer."""
    offsets, parent, last_seen, rel = shape.offsets, shape.parent, known.last_seen, known.rel
    mine = known.slot_of[me]
    above = parent[mine]
    if above == NO_PARENT:
        return NOBODY
    leader: int = known.occupant[above]
    if tick - last_seen[leader] <= rules.silent_ticks:
        return NOBODY
    # The vacant slot, relative to me.
    tx = error[0] + offsets[above, 0] - offsets[mine, 0]
    ty = error[1] + offsets[above, 1] - offsets[mine, 1]
    my_distance = tx * tx + ty * ty
    if my_distance > radio.range_m * radio.range_m:
        return NOBODY
    for slot in range(parent.shape[0]):
        sibling = known.occupant[slot]
        if (
            parent[slot] != above
            or sibling == me
            or tick - last_seen[sibling] > rules.silent_ticks
            or known.hops[sibling] == UNKNOWN
        ):
            continue
        away_x, away_y = tx - rel[sibling, 0], ty - rel[sibling, 1]
        distance = away_x * away_x + away_y * away_y
        if distance < my_distance or (distance == my_distance and sibling < me):
            return NOBODY
    return leader
