"""Everything the compiled parts of a drone's tick work on, handed to them as one object: `TickArrays`."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.control.gains import Gains, SafetyLimits
from agent.memory import Memory
from protocols.relative import RadioRules
from protocols.slots import trigger
from protocols.slots.trigger import Shape, SwapRules
from protocols.wire.frames import OBSERVATION_SIZE, Frames
from protocols.wire.sensed import Sensed


class Rules(NamedTuple):
    """What a mission means in ticks, metres and yes or no.

    by_sensor: neighbours are sensed, not heard. chain: aim at the leader's position. filtered: the safety filter is on.
    frame_every: ticks from frame to frame. reach_m: of the sensors.
    """

    by_sensor: bool
    remember_obstacles: bool
    chain: bool
    detour: bool
    filtered: bool
    frame_every: int
    reach_m: float
    target_mps: float
    radio: RadioRules
    swap: SwapRules
    gains: Gains
    limits: SafetyLimits


class Views(NamedTuple):
    """Each drone's view of the slots: slot_of, occupant (A, N); its own slot, its swap set's digest, whether its protocol is
    busy: (A,)."""

    slot_of: NDArray[np.int64]
    occupant: NDArray[np.int64]
    slot: NDArray[np.int64]
    digest: NDArray[np.uint64]
    busy: NDArray[np.bool_]


class Work(NamedTuple):
    """One tick's inputs and results. Row r hears frames ``inbox[inbox_start[r]:inbox_start[r + 1]]``.

    me, awake: (A,). target_position, target_velocity: (A, 2) the virtual target now (agent.target) [m], [m/s]. chain_error,
    slot_error: (A, 2) [m]. observation: (A, 18). means: (A, L, 18) of the neighbours' (agent.relay), L = 0 where no policy asks.
    partner, vacated: (A,) whom to swap with, whose place to take, or NOBODY. news: (A,) whether the slot protocol has something
    to attend to. sent: (A,) a frame was composed.
    """

    me: NDArray[np.int64]
    awake: NDArray[np.bool_]
    inbox_start: NDArray[np.int64]
    inbox: NDArray[np.int64]
    target_position: NDArray[np.float64]
    target_velocity: NDArray[np.float64]
    chain_error: NDArray[np.float64]
    slot_error: NDArray[np.float64]
    observation: NDArray[np.float64]
    means: NDArray[np.float64]
    partner: NDArray[np.int64]
    vacated: NDArray[np.int64]
    news: NDArray[np.bool_]
    sent: NDArray[np.bool_]


class TickArrays(NamedTuple):
    """Everything together; kernels take it `protocols.kernels.by_reference`."""

    rules: Rules
    shape: Shape
    views: Views
    work: Work
    sensed: Sensed
    frames: Frames
    memory: Memory


def empty_views(rows: int, agents: int) -> Views:
    """Views to be filled by the slot protocol."""
    return Views(
        slot_of=np.zeros((rows, agents), np.int64),
        occupant=np.zeros((rows, agents), np.int64),
        slot=np.zeros(rows, np.int64),
        digest=np.zeros(rows, np.uint64),
        busy=np.zeros(rows, np.bool_),
    )


def empty_work(me: NDArray[np.int64], rounds: int = 0) -> Work:
    """A tick's arrays for the drones numbered ``me``, all awake, hearing nothing; ``rounds``: of aggregation over the air."""
    rows = len(me)
    return Work(
        me=me,
        awake=np.ones(rows, np.bool_),
        inbox_start=np.zeros(rows + 1, np.int64),
        inbox=np.zeros(0, np.int64),
        target_position=np.zeros((rows, 2)),
        target_velocity=np.zeros((rows, 2)),
        chain_error=np.zeros((rows, 2)),
        slot_error=np.zeros((rows, 2)),
        observation=np.zeros((rows, OBSERVATION_SIZE)),
        means=np.zeros((rows, rounds, OBSERVATION_SIZE)),
        partner=np.full(rows, trigger.NOBODY, np.int64),
        vacated=np.full(rows, trigger.NOBODY, np.int64),
        news=np.zeros(rows, np.bool_),
        sent=np.zeros(rows, np.bool_),
    )
