"""The compiled parts of a learned policy: what it remembers, what its model is given, and flying its plans."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.control.follow import Following, Plan, follow_row
from agent.memory import Memory, discs_of, neighbours_of
from agent.observation import WIDE_SIZE, aim_of, compressed, observe_wide_row
from agent.quick import RARE, Quick, begin_tick, end_tick, tick_of
from agent.relay import tells
from agent.tick_arrays import Rules, TickArrays, Work
from protocols.dynamics import TICK_S, vector
from protocols.kernels import inlined_kernel, kernel
from protocols.relative import NEVER
from protocols.wire.frames import OBSERVATION_SIZE, OBSERVATION_UNIT
from protocols.wire.messages import REPLY_AT
from protocols.wire.rows import put_bytes, put_number

DUE = -2  # for a plan


class History(NamedTuple):
    """What each row saw and heard at its last L ticks, newest last.

    own: (A, L, 18). heard: (A, L, K, 18). share: (A, L, K). blank: (A,) whether the row has seen nothing yet. K = 0 where the
    model takes means over the air instead.
    """

    own: NDArray[np.float32]
    heard: NDArray[np.float32]
    share: NDArray[np.float32]
    blank: NDArray[np.bool_]


class Question(NamedTuple):
    """A model's inputs for the rows that are due for a plan, one after the other; ``row`` (A,) says which they are. wide: (32,)
    room to make ``extra`` in, of the type in which a drone observes: one more would take long to compile."""

    row: NDArray[np.int64]
    own: NDArray[np.float32]
    heard: NDArray[np.float32]
    share: NDArray[np.float32]
    means: NDArray[np.float32]
    target: NDArray[np.float32]
    extra: NDArray[np.float32]
    wide: NDArray[np.float64]


class Plans(NamedTuple):
    """Each row's plan, as in agent.control.follow; made_at: (A,) tick, NEVER where there is none."""

    made_at: NDArray[np.int64]
    start: NDArray[np.float64]
    displacement: NDArray[np.float32]
    acceleration: NDArray[np.float32]


def empty_history(rows: int, past: int, neighbours: int) -> History:
    """Nothing seen yet."""
    return History(
        own=np.zeros((rows, past, OBSERVATION_SIZE), np.float32),
        heard=np.zeros((rows, past, neighbours, OBSERVATION_SIZE), np.float32),
        share=np.zeros((rows, past, neighbours), np.float32),
        blank=np.ones(rows, np.bool_),
    )


def empty_question(rows: int, past: int, neighbours: int, rounds: int) -> Question:
    """Room for the inputs of ``rows`` rows; ``rounds``: of aggregation over the air."""
    return Question(
        row=np.zeros(rows, np.int64),
        own=np.zeros((rows, past, OBSERVATION_SIZE), np.float32),
        heard=np.zeros((rows, past, neighbours, OBSERVATION_SIZE), np.float32),
        share=np.zeros((rows, past, neighbours), np.float32),
        means=np.zeros((rows, rounds, OBSERVATION_SIZE), np.float32),
        target=np.zeros((rows, 2), np.float32),
        extra=np.zeros((rows, WIDE_SIZE), np.float32),
        wide=np.zeros(WIDE_SIZE),
    )


def empty_plans(rows: int, horizon: int) -> Plans:
    """No row has a plan."""
    return Plans(
        made_at=np.full(rows, NEVER),
        start=np.zeros((rows, 4)),
        displacement=np.zeros((rows, horizon, 2), np.float32),
        acceleration=np.zeros((rows, horizon, 2), np.float32),
    )


class Planner(NamedTuple):
    """All that the kernels here work on; they take it `protocols.kernels.by_reference`.

    replan: ticks between plans. wanted: (A, 2) m/s^2, what flying the plans takes now.
    """

    replan: int
    following: Following
    history: History
    question: Question
    plans: Plans
    wanted: NDArray[np.float64]


@inlined_kernel
def _copy_tick(source: Any, row: int, tick: int, target: Any, place: int, target_tick: int) -> None:
    """What row ``row`` of ``source`` holds of one of its ticks, into ``target``; both have own, heard and share.

    Loops, because assigning slices of such arrays takes half a minute to compile.
    """
    places, size = source.heard.shape[2], source.heard.shape[3]
    for index in range(size):
        target.own[place, target_tick, index] = source.own[row, tick, index]
    for other in range(places):
        target.share[place, target_tick, other] = source.share[row, tick, other]
        for index in range(size):
            target.heard[place, target_tick, other, index] = source.heard[row, tick, other, index]


@inlined_kernel
def _note_row(tick: int, row: int, rules: Rules, work: Work, memory: Memory, history: History) -> None:
    """Add this tick to a row's history; one that is shorter than L repeats its first entry.

    Heard are the drones whose frames are believed: all of the tick before, and older ones of drones still near. Of more than K
    the lowest agent numbers count.
    """
    own, heard, share = history.own[row], history.heard[row], history.share[row]
    past, places = share.shape
    for step in range(past - 1):
        _copy_tick(history, row, step + 1, history, row, step)
    last = past - 1
    for index in range(OBSERVATION_SIZE):
        own[last, index] = work.observation[row, index]
    count = 0
    for other in range(memory.heard_tick.shape[1]):
        if count < places and tells(tick, row, other, rules.radio, memory):
            for index in range(OBSERVATION_SIZE):
                heard[last, count, index] = memory.heard_observation[row, other, index] / OBSERVATION_UNIT
            count += 1
    for place in range(places):
        share[last, place] = 1.0 / count if place < count else 0.0
    for place in range(count, places):
        for index in range(OBSERVATION_SIZE):
            heard[last, place, index] = 0.0
    if history.blank[row]:
        history.blank[row] = False
        for step in range(last):
            _copy_tick(history, row, last, history, row, step)


@inlined_kernel
def _ask_row(
    row: int, place: int, rules: Rules, work: Work, memory: Memory, history: History, question: Question
) -> None:
    question.row[place] = row
    for step in range(history.own.shape[1]):
        _copy_tick(history, row, step, question, place, step)
    rounds = question.means.shape[1]
    for passed_on in range(rounds):  # the newest information last, as in the history
        for index in range(OBSERVATION_SIZE):
            question.means[place, rounds - 1 - passed_on, index] = work.means[row, passed_on, index]
    x, y = compressed(work.chain_error[row, 0], work.chain_error[row, 1])
    question.target[place, 0], question.target[place, 1] = x, y
    observe_wide_row(row, rules.reach_m, memory, question.wide)
    for index in range(WIDE_SIZE):
        question.extra[place, index] = question.wide[index]


@inlined_kernel
def _fly(tick: int, arrays: TickArrays, planner: Planner) -> None:
    work, sensed, memory = arrays.work, arrays.sensed, arrays.memory
    flown, wanted = planner.plans, planner.wanted
    for row in range(work.me.shape[0]):
        if work.awake[row]:
            plan = Plan(flown.start[row], flown.displacement[row], flown.acceleration[row])
            wanted[row, 0], wanted[row, 1] = follow_row(
                tick - flown.made_at[row], plan, vector(sensed.position, row), aim_of(row, work, sensed),
                neighbours_of(memory, row), discs_of(memory, row), planner.following,
            )  # fmt: skip


@inlined_kernel
def _is_due(tick: int, row: int, work: Work, planner: Planner) -> bool:
    turn = (tick + work.me[row]) % planner.replan == 0
    return bool(turn or tick - planner.plans.made_at[row] >= planner.plans.displacement.shape[1])


@inlined_kernel
def _counts(tick: int, row: int, work: Work, planner: Planner) -> bool:
    """Whether a model will look back at this tick: at what was before the last L ticks it does not."""
    return bool((tick + work.me[row]) % planner.replan > planner.replan - planner.history.own.shape[1])


@inlined_kernel
def _ask(tick: int, arrays: TickArrays, planner: Planner) -> int:
    """Note what every awake row sees and hears, and write the model's inputs for those that are due for a plan.

    Drones take turns: with ``replan`` ticks between plans, drone i plans when tick + i is a multiple of it, and besides when
    it has no plan or has flown it to its end.

    Returns:
        How many rows are due.
    """
    rules, work, memory = arrays.rules, arrays.work, arrays.memory
    seen, asked, due = planner.history, planner.question, 0
    for row in range(work.me.shape[0]):
        if not work.awake[row]:
            continue
        is_due = _is_due(tick, row, work, planner)
        if is_due or _counts(tick, row, work, planner):
            _note_row(tick, row, rules, work, memory, seen)
        if is_due:
            _ask_row(row, due, rules, work, memory, seen, asked)
            due += 1
    return due


@kernel
def ask_or_fly(planned: bool, tick: int, arrays: TickArrays, planner: Planner) -> int:
    """As `_ask`; if no row is due, or all that were are ``planned`` for, write ``planner.wanted`` of all awake rows.

    One rule for both, so that flying plans is compiled once.
    """
    due = 0 if planned else _ask(tick, arrays, planner)
    if due == 0:
        _fly(tick, arrays, planner)
    return due


@kernel
def take_plans(
    tick: int,
    count: int,
    arrays: TickArrays,
    planner: Planner,
    displacement: NDArray[np.float32],
    acceleration: NDArray[np.float32],
) -> None:
    """Give the ``count`` rows that were asked about their new plans, (A, H, 2), beginning here and now."""
    sensed, plans, asked = arrays.sensed, planner.plans, planner.question.row
    for place in range(count):
        row = asked[place]
        plans.made_at[row] = tick
        for axis in range(2):
            plans.start[row, axis] = sensed.position[row, axis]
            plans.start[row, 2 + axis] = sensed.velocity[row, axis]
        for step in range(displacement.shape[1]):
            for axis in range(2):
                plans.displacement[row, step, axis] = displacement[place, step, axis]
                plans.acceleration[row, step, axis] = acceleration[place, step, axis]


@kernel
def show_plans(
    now: NDArray[np.int64], after: NDArray[np.int64], plans: Plans, shown: NDArray[np.float32]
) -> None:
    """Where each row plans to be so many ticks ``after`` (P,) it planned: ``shown`` (A, P, 2) m, NaN for what lies behind it as
    tick ``now`` (1,) begins, and where it has planned nothing."""
    for row in range(shown.shape[0]):
        made_at = plans.made_at[row]
        for moment in range(after.shape[0]):
            ahead = made_at != NEVER and made_at + after[moment] > now[0]
            for axis in range(2):
                place = math.nan
                if ahead:
                    drift = plans.start[row, 2 + axis] * (TICK_S * after[moment])
                    place = plans.start[row, axis] + drift + plans.displacement[row, after[moment] - 1, axis]
                shown[row, moment, axis] = place


class Telling(NamedTuple):
    """How a drone tells those who look on of a plan (protocols.wire.planned). after: (P,) ticks, and packed; now, shown: as in
    `show_plans`, and the latter's bytes."""

    after: NDArray[np.int64]
    after_bytes: NDArray[np.uint8]
    now: NDArray[np.int64]
    shown: NDArray[np.float32]
    shown_bytes: NDArray[np.uint8]


@inlined_kernel
def _add_plan(tick: int, size: int, plans: Plans, telling: Telling, answer: NDArray[np.uint8]) -> int:
    """Write what has just been planned behind a Reply of so many bytes; its size then."""
    telling.now[0] = tick
    show_plans(telling.now, telling.after, plans, telling.shown)
    end = put_bytes(answer, size, telling.after_bytes, 0, telling.after_bytes.shape[0])
    end = put_bytes(answer, end, telling.shown_bytes, 0, telling.shown_bytes.shape[0])
    put_number(answer, REPLY_AT.plan_size, end - size, 2)
    return end


@kernel
def fly_quickly(
    planned: bool,
    quick: Quick,
    planner: Planner,
    displacement: NDArray[np.float32],
    acceleration: NDArray[np.float32],
    telling: Telling,
) -> int:
    """A drone's whole tick (agent.quick); `DUE` where the model is to be asked, and once it has been, ``planned``, the rest.

    One rule for both, so that what they share is compiled once. displacement, acceleration: the new plan, as in `take_plans`.
    """
    arrays, tick = quick.arrays, tick_of(quick)
    if planned:
        take_plans(tick, 1, arrays, planner, displacement, acceleration)
    elif begin_tick(quick) < 0:
        return RARE
    elif _ask(tick, arrays, planner) > 0:
        return DUE
    _fly(tick, arrays, planner)
    size = end_tick(tick, quick)
    if planned and size > 0 and quick.telling[0] and displacement.shape[1] > 1:
        size = _add_plan(tick, size, planner.plans, telling, quick.answer)
    return size
