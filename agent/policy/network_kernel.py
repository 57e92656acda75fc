"""The networks of learned policies (paper, Sec. III-A) as compiled rules: the same bits on every processor.

A library uses what the processor at hand can do and adds up in another order on the next; a flight then differs in its last bits,
and soon altogether. Here each sum goes over the inputs in their order. The loops over outputs are what a processor may do several
of at once. Numbers are float32, as the weights are.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.policy.layers import ZERO, Floats, Layer, Normal, dense, layer_norm, rectify, z_score
from agent.policy.learned_kernel import Question
from protocols.arithmetic import exp
from protocols.kernels import inlined_kernel, wide_kernel

_SLOPE = np.float32(0.01)


class Rsc(NamedTuple):
    """Weights of the paper's network, W wide, over L ticks. when: (L, W).
    displacement, acceleration: (M, H), what M points on an axis mean at H ticks (rsc_swarm.training.plan)."""

    heads: int
    seen: Normal
    target: Normal
    node_in: Layer
    node_out: Layer
    from_own: Layer
    from_neighbours: Layer
    when: Floats
    query: Layer
    key: Layer
    value: Layer
    attended: Layer
    norm_attended: Normal
    forward_in: Layer
    forward_out: Layer
    norm_forward: Normal
    local_in: Layer
    local_out: Layer
    head_in: Layer
    head_out: Layer
    displacement: Floats
    acceleration: Floats


class Stgnn(NamedTuple):
    """Weights of the baseline's network; the last two as of `Rsc`."""

    seen: Normal
    target: Normal
    first: Layer
    second: Layer
    third: Layer
    last: Layer
    displacement: Floats
    acceleration: Floats


class Room(NamedTuple):
    """Room for what is worked out on the way: rows of X_i, (R, 18), with R = L (1 + K), and of W numbers; tick: (R,) which of L
    ticks a row is of. share: (R,) of the mean of its tick; 0 for what the drone saw itself. local: (1, F)."""

    x: Floats
    tick: NDArray[np.int64]
    share: Floats
    hidden: Floats
    node: Floats
    own: Floats
    mean: Floats
    step: Floats
    since: Floats
    key: Floats
    value: Floats
    query: Floats
    context: Floats
    forward: Floats
    local: Floats
    local_hidden: Floats
    both: Floats
    points: Floats


@inlined_kernel
def _rows_of(place: int, asked: Question, seen: Normal, room: Room) -> int:
    """Write to ``room.x`` what the drone has seen itself and what it has heard, normalised; how many rows. Places that nobody has
    taken are left out."""
    rows, places, passed_on = 0, asked.share.shape[2], asked.means.shape[1]
    for tick in range(asked.own.shape[1]):
        for j in range(asked.own.shape[2]):
            room.x[rows, j] = z_score(asked.own[place, tick, j], seen, j)
        room.tick[rows], room.share[rows] = tick, ZERO
        rows += 1
        for other in range(places):
            share = asked.share[place, tick, other]
            if share > ZERO:
                for j in range(asked.own.shape[2]):
                    room.x[rows, j] = z_score(asked.heard[place, tick, other, j], seen, j)
                room.tick[rows], room.share[rows] = tick, share
                rows += 1
        if passed_on > 0:
            for j in range(asked.own.shape[2]):
                room.x[rows, j] = z_score(asked.means[place, tick, j], seen, j)
            room.tick[rows], room.share[rows] = tick, np.float32(1.0)
            rows += 1
    return rows


@inlined_kernel
def _gather(rows: int, node: Floats, room: Room) -> None:
    """What the drone saw itself at each tick, and the mean of what it heard: ``room.own`` and ``room.mean`` of these ``node``."""
    width = node.shape[1]
    for tick in range(room.mean.shape[0]):
        for j in range(width):
            room.mean[tick, j] = ZERO
    for row in range(rows):
        tick, share = room.tick[row], room.share[row]
        if share > ZERO:
            for j in range(width):
                room.mean[tick, j] += share * node[row, j]
        else:
            for j in range(width):
                room.own[tick, j] = node[row, j]


@inlined_kernel
def _local(place: int, asked: Question, target: Normal, room: Room) -> None:
    """Where to, and what else is near, normalised, into ``room.local``."""
    for j in range(2):
        room.local[0, j] = z_score(asked.target[place, j], target, j)
    for j in range(2, target.mean.shape[0]):
        room.local[0, j] = z_score(asked.extra[place, j - 2], target, j)


@inlined_kernel
def _attend(heads: int, ticks: int, room: Room) -> None:
    """Attention of the newest of these ticks, by head, into ``room.context``; its query, keys and values are there."""
    width = room.query.shape[1]
    size = width // heads
    scale = 1.0 / math.sqrt(np.float64(size))
    for head in range(heads):
        begin, end, most, total = head * size, (head + 1) * size, -math.inf, 0.0
        for tick in range(ticks):
            score = 0.0
            for j in range(begin, end):
                score += np.float64(room.query[0, j]) * np.float64(room.key[tick, j])
            most = max(most, score * scale)
        for j in range(begin, end):
            room.context[0, j] = ZERO
        for tick in range(ticks):
            score = 0.0
            for j in range(begin, end):
                score += np.float64(room.query[0, j]) * np.float64(room.key[tick, j])
            weight = exp(score * scale - most)
            total += weight
            for j in range(begin, end):
                room.context[0, j] += np.float32(weight) * room.value[tick, j]
        for j in range(begin, end):
            room.context[0, j] /= np.float32(total)


@inlined_kernel
def _write_plan(
    place: int, points: Floats, displacement: Floats, acceleration: Floats, out: tuple[Floats, Floats]
) -> None:
    """A plan from its points: out (D, H, 2) each."""
    count, horizon = displacement.shape
    for step in range(horizon):
        for axis in range(2):
            far, fast = ZERO, ZERO
            for m in range(count):
                far += points[0, axis * count + m] * displacement[m, step]
                fast += points[0, axis * count + m] * acceleration[m, step]
            out[0][place, step, axis], out[1][place, step, axis] = far, fast


@wide_kernel
def plan_rsc(
    first: int, end: int, asked: Question, net: Rsc, room: Room, displacement: NDArray[np.float32],
    acceleration: NDArray[np.float32],
) -> None:  # fmt: skip
    """Plan for places ``first`` to ``end`` of what is asked: displacement, acceleration (A, H, 2), from place 0 on."""
    width, ticks = net.from_own.bias.shape[0], net.when.shape[0]
    for place in range(first, end):
        rows = _rows_of(place, asked, net.seen, room)
        dense(room.x, rows, net.node_in, room.hidden)
        rectify(room.hidden, rows, width, ZERO)
        dense(room.hidden, rows, net.node_out, room.node)
        rectify(room.node, rows, width, ZERO)
        _gather(rows, room.node, room)
        dense(room.own, ticks, net.from_own, room.step)
        dense(room.mean, ticks, net.from_neighbours, room.since)
        for tick in range(ticks):
            for j in range(width):
                both = room.step[tick, j] + room.since[tick, j]
                room.step[tick, j] = (both if both > ZERO else ZERO) + net.when[tick, j]
        for tick in range(ticks):  # what all keys have in common changes no share
            for j in range(width):
                room.since[tick, j] = room.step[tick, j] - room.step[ticks - 1, j]
        dense(room.step[ticks - 1 :], 1, net.query, room.query)
        dense(room.since, ticks, net.key, room.key)
        dense(room.step, ticks, net.value, room.value)
        _attend(net.heads, ticks, room)
        dense(room.context, 1, net.attended, room.both)
        for j in range(width):
            room.both[0, j] += room.step[ticks - 1, j]
        layer_norm(room.both, net.norm_attended)
        dense(room.both, 1, net.forward_in, room.forward)
        rectify(room.forward, 1, net.forward_in.bias.shape[0], ZERO)
        dense(room.forward, 1, net.forward_out, room.context)
        for j in range(width):
            room.both[0, j] += room.context[0, j]
        layer_norm(room.both, net.norm_forward)
        _local(place, asked, net.target, room)
        dense(room.local, 1, net.local_in, room.local_hidden)
        rectify(room.local_hidden, 1, width, _SLOPE)
        dense(room.local_hidden, 1, net.local_out, room.context)
        rectify(room.context, 1, width, _SLOPE)
        for j in range(width):
            room.both[0, width + j] = room.context[0, j]
        dense(room.both, 1, net.head_in, room.hidden)
        rectify(room.hidden, 1, width, _SLOPE)
        dense(room.hidden, 1, net.head_out, room.points)
        _write_plan(
            place - first, room.points, net.displacement, net.acceleration, (displacement, acceleration)
        )


@wide_kernel
def plan_stgnn(
    first: int, end: int, asked: Question, net: Stgnn, room: Room, displacement: NDArray[np.float32],
    acceleration: NDArray[np.float32],
) -> None:  # fmt: skip
    """As `plan_rsc`, by the baseline's network."""
    ticks, size, width = asked.own.shape[1], asked.own.shape[2], net.first.bias.shape[0]
    for place in range(first, end):
        _gather(_rows_of(place, asked, net.seen, room), room.x, room)
        for j in range(size):
            room.both[0, j] = room.own[ticks - 1, j]
        for tick in range(ticks):
            for j in range(size):
                room.both[0, (1 + tick) * size + j] = room.mean[tick, j]
        _local(place, asked, net.target, room)
        for j in range(net.target.mean.shape[0]):
            room.both[0, (1 + ticks) * size + j] = room.local[0, j]
        dense(room.both, 1, net.first, room.hidden)
        rectify(room.hidden, 1, width, ZERO)
        dense(room.hidden, 1, net.second, room.node)
        rectify(room.node, 1, width, ZERO)
        dense(room.node, 1, net.third, room.hidden)
        rectify(room.hidden, 1, width, ZERO)
        dense(room.hidden, 1, net.last, room.points)
        _write_plan(
            place - first, room.points, net.displacement, net.acceleration, (displacement, acceleration)
        )
