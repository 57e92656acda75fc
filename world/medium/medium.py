"""The radio medium: which frame reaches whom, and when.

One frame on one link gets one verdict: lost to a named rule, or delivered after so many ticks, once or twice. The rules
are asked in this order, and the first that drops a frame decides:

    range      beyond R_c at the moment of sending            (counted as out of range, not as a drop)
    partition  sender and receiver are in different groups
    burst      the link's Gilbert-Elliott channel is in its bad state
    loss       independent loss
    jitter     adds a uniform share of jitter ticks to the fixed delay
    reorder    holds the frame back so that later ones overtake it
    duplicate  delivers a second copy a little later

A frame without delay arrives at the next tick: one tick per hop. Every draw is world.medium.chance's, so verdicts do not
depend on the order in which they are asked.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import TICK_S
from protocols.kernels import allocating_kernel, kernel
from protocols.mission.document import Mission
from world.medium import chance
from world.order import put_in_order, span

# Columns of the tally a medium keeps per world.
(
    SENT,
    SENT_BYTES,
    DELIVERED,
    DELIVERED_BYTES,
    OUT_OF_RANGE,
    PARTITION,
    BURST,
    LOSS,
    TO_NOBODY,
    HELD_BACK,
    DOUBLED,
) = range(11)
TALLY = ("sent", "sent_bytes", "delivered", "delivered_bytes", "out_of_range", "partition", "burst", "loss", "to_nobody",
         "held_back", "doubled")  # fmt: skip

FATES = CARRIED, LOST, DELAYED = range(3)
LONG_AGO = -(1 << 30)  # no frame yet

MAX_FANOUT = 48  # receivers one frame is queued for, and twice that with duplicates
_HOLD_MIN, _HOLD_SPAN = 2, 4  # a reordered frame waits 2 to 5 ticks more
_COPY_SPAN = 3  # a duplicate comes 1 to 3 ticks after the first


class Link(NamedTuple):
    """The link rules of a mission in ticks and probabilities, but for the loss, which faults change (`Air`)."""

    range_m: float
    burst_enter: float  # probability per tick to go from good to bad
    burst_leave: float  # and back
    delay: float  # ticks
    jitter: float  # ticks
    reorder: float
    duplicate: float

    @property
    def longest(self) -> int:
        """No frame is under way for more ticks than this."""
        return int(1 + self.delay + self.jitter + 1) + _HOLD_MIN + _HOLD_SPAN + _COPY_SPAN


def link_of(mission: Mission) -> Link:
    """The mission's radio as rules per tick."""
    radio = mission.radio
    mean, leave = radio.burst.loss, TICK_S / radio.burst.length_s
    # Stationary share of bad time = enter / (enter + leave); a mission's spells are long enough for enter <= 1.
    enter, leave = (min(1.0, leave * mean / (1 - mean)), leave) if mean < 1 else (1.0, 0.0)
    per_tick = 0.001 / TICK_S
    return Link(
        radio.range_m,
        enter,
        leave,
        radio.delay_ms * per_tick,
        radio.jitter_ms * per_tick,
        radio.reorder,
        radio.duplicate,
    )


@kernel
def dropped_by(
    loss: float, seed: int, source: int, destination: int, tick: int, same_group: bool, bad: bool
) -> int:
    """The tally column of the rule that loses this frame, or 0 if none does."""
    if not same_group:
        return PARTITION
    if bad:
        return BURST
    if loss > 0 and chance.uniform(seed, chance.LOSS, source, destination, tick) < loss:
        return LOSS
    return 0


@kernel
def ticks_under_way(link: Link, seed: int, source: int, destination: int, tick: int) -> tuple[int, bool]:
    """Ticks until the frame arrives (at least 1), and whether it was held back out of order."""
    delay = link.delay
    if link.jitter > 0:
        delay += link.jitter * chance.uniform(seed, chance.JITTER, source, destination, tick)
    ticks = 1 + int(delay + 0.5)
    if link.reorder > 0:
        draw = chance.uniform(seed, chance.REORDER, source, destination, tick)
        if draw < link.reorder:
            return ticks + _HOLD_MIN + int(draw / link.reorder * _HOLD_SPAN), True
    return ticks, False


@kernel
def copy_lag(link: Link, seed: int, source: int, destination: int, tick: int) -> int:
    """Ticks after the first copy at which a duplicate arrives; 0 for no duplicate."""
    if link.duplicate > 0:
        draw = chance.uniform(seed, chance.DUPLICATE, source, destination, tick)
        if draw < link.duplicate:
            return 1 + int(draw / link.duplicate * _COPY_SPAN)
    return 0


@kernel
def age_channels(link: Link, seed: int, tick: int, bad: NDArray[np.bool_]) -> None:
    """Move every directed link's Gilbert-Elliott state, bad (N, N), on by one tick; tick 0 draws the stationary state."""
    stationary = link.burst_enter / (link.burst_enter + link.burst_leave)
    for source in range(bad.shape[0]):
        for destination in range(bad.shape[0]):
            draw = chance.uniform(seed, chance.BURST, source, destination, tick)
            if tick == 0:
                bad[source, destination] = draw < stationary
            elif bad[source, destination]:
                bad[source, destination] = draw >= link.burst_leave
            else:
                bad[source, destination] = draw < link.burst_enter


class Queue(NamedTuple):
    """Frames under way, per world, in a ring of arrival ticks.

    waiting: (E, D); entry: (E, D, capacity, 3) destination, source, tick of sending.
    """

    waiting: NDArray[np.int64]
    entry: NDArray[np.int32]


def empty_queue(worlds: int, agents: int, longest: int) -> Queue:
    """A queue for frames that take up to ``longest`` ticks."""
    usual = agents * min(max(agents - 1, 1), MAX_FANOUT) * 2
    # Jitter makes frames of several ticks arrive at once: far more than their number ever scatters.
    capacity = usual + 16 + 12 * math.isqrt(usual)
    return Queue(
        np.zeros((worlds, longest + 1), np.int64), np.zeros((worlds, longest + 1, capacity, 3), np.int32)
    )


@kernel
def _enqueue(queue: Queue, world: int, arrival: int, destination: int, source: int, tick: int) -> None:
    bucket = arrival % queue.waiting.shape[1]
    index = queue.waiting[world, bucket]
    if index < queue.entry.shape[2]:
        queue.entry[world, bucket, index, 0] = destination
        queue.entry[world, bucket, index, 1] = source
        queue.entry[world, bucket, index, 2] = tick
        queue.waiting[world, bucket] = index + 1


class Clocks(NamedTuple):
    """Of each world (E,): its seed, its tick, and whether its flight goes on."""

    seeds: NDArray[np.int64]
    ticks: NDArray[np.int64]
    active: NDArray[np.bool_]


class Air(NamedTuple):
    """Who is where on the air.

    alive, group: (E, N). loss: (E,) share of frames lost independently. position: (E, N, 2) metres. sent_bytes: (E, N) size of
    this tick's frame, 0 for none. fates: (E, N, N, 3) for who looks on, updated: the tick of the last frame from source to
    destination that was carried, lost or delayed, per `FATES`; of nobody (E, 0, 0, 3) where nobody does. by_x: (E, N) drone
    numbers (world.order).
    """

    alive: NDArray[np.bool_]
    group: NDArray[np.int16]
    loss: NDArray[np.float64]
    position: NDArray[np.float64]
    sent_bytes: NDArray[np.int64]
    fates: NDArray[np.int32]
    by_x: NDArray[np.int64]


@allocating_kernel
def relay(
    link: Link, clocks: Clocks, air: Air, bad: NDArray[np.bool_], queue: Queue, tally: NDArray[np.int64]
) -> None:
    """Judge the frames sent at this tick in every active world and queue what will arrive.

    Args:
        bad: (E, N, N) channel states, updated. queue, tally (E, 11): updated.
    """
    alive, position, sent_bytes, fates, by_x = air.alive, air.position, air.sent_bytes, air.fates, air.by_x
    worlds, agents = alive.shape
    watched = fates.shape[1] > 0
    reach = link.range_m * link.range_m
    place_of = np.empty(agents, np.int64)
    for world in range(worlds):
        if not clocks.active[world]:
            continue
        seed, tick, receivers = clocks.seeds[world], clocks.ticks[world], 0
        if link.burst_enter > 0:
            age_channels(link, seed, tick, bad[world])
        put_in_order(by_x[world], position[world])
        for place in range(agents):
            place_of[by_x[world, place]] = place
            receivers += alive[world, place]
        for source in range(agents):
            size = sent_bytes[world, source]
            if size == 0:
                continue
            tally[world, SENT] += 1
            tally[world, SENT_BYTES] += size
            tally[world, OUT_OF_RANGE] += receivers - alive[world, source]  # but for those in range
            first, last = span(by_x[world], position[world], place_of[source], link.range_m)
            for place in range(first, last):
                destination = by_x[world, place]
                dx = position[world, source, 0] - position[world, destination, 0]
                dy = position[world, source, 1] - position[world, destination, 1]
                if dx * dx + dy * dy > reach or destination == source or not alive[world, destination]:
                    continue
                tally[world, OUT_OF_RANGE] -= 1
                same_group = air.group[world, source] == air.group[world, destination]
                rule = dropped_by(
                    air.loss[world],
                    seed,
                    source,
                    destination,
                    tick,
                    same_group,
                    bad[world, source, destination],
                )
                if rule > 0:
                    tally[world, rule] += 1
                    if watched:
                        fates[world, source, destination, LOST] = tick
                    continue
                lag, held_back = ticks_under_way(link, seed, source, destination, tick)
                if watched:
                    fates[world, source, destination, CARRIED if lag == 1 else DELAYED] = tick
                _enqueue(queue, world, tick + lag, destination, source, tick)
                tally[world, HELD_BACK] += held_back
                lag_of_copy = copy_lag(link, seed, source, destination, tick)
                if lag_of_copy > 0:
                    _enqueue(queue, world, tick + lag + lag_of_copy, destination, source, tick)
                    tally[world, DOUBLED] += 1


@allocating_kernel
def deliver(
    ticks: NDArray[np.int64],
    active: NDArray[np.bool_],
    hears: NDArray[np.bool_],
    sizes: NDArray[np.int64],
    queue: Queue,
    tally: NDArray[np.int64],
    start: NDArray[np.int64],
    arrived: NDArray[np.int32],
) -> int:
    """Take out of the queue what arrives at this tick, ordered by destination, then source, then tick of sending.

    Args:
        ticks, active: (E,). hears: (E, N) whose radio is on. sizes: (E, D, N) bytes of the frames sent, by tick % D.
        start: (E*N + 1,) out: frames of row r are arrived[start[r]:start[r + 1]]. arrived: (>= all, 2) out: source row
            and tick of sending.

    Returns:
        The number of frames that arrived.
    """
    worlds, agents = hears.shape
    cursor = np.empty(agents, np.int64)
    total = 0
    for world in range(worlds):
        base = world * agents
        bucket = ticks[world] % queue.waiting.shape[1]
        waiting = queue.waiting[world, bucket] if active[world] else 0
        queue.waiting[world, bucket] = 0
        for destination in range(agents):
            cursor[destination] = 0
        for index in range(waiting):
            destination = queue.entry[world, bucket, index, 0]
            if hears[world, destination]:
                cursor[destination] += 1
            else:
                tally[world, TO_NOBODY] += 1
        for destination in range(agents):
            size = cursor[destination]
            start[base + destination] = total
            cursor[destination] = total
            total += size
        for index in range(waiting):
            destination = queue.entry[world, bucket, index, 0]
            if not hears[world, destination]:
                continue
            source, sent = base + queue.entry[world, bucket, index, 1], queue.entry[world, bucket, index, 2]
            tally[world, DELIVERED] += 1
            tally[world, DELIVERED_BYTES] += sizes[world, sent % sizes.shape[1], source - base]
            # Entries were queued tick by tick and source by source, so this insertion sort rarely moves anything.
            at = cursor[destination]
            cursor[destination] += 1
            while at > start[base + destination] and (
                arrived[at - 1, 0] > source or (arrived[at - 1, 0] == source and arrived[at - 1, 1] > sent)
            ):
                # Number by number: copying a row takes four seconds to compile.
                arrived[at, 0], arrived[at, 1] = arrived[at - 1, 0], arrived[at - 1, 1]
                at -= 1
            arrived[at, 0] = source
            arrived[at, 1] = sent
    start[worlds * agents] = total
    return total
