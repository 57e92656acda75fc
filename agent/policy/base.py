"""The policy interface: a policy is a class whose constructor takes the mission and which has one method, ``act``."""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from agent.memory import Memory
from agent.tick_arrays import TickArrays
from protocols.errors import SwarmError


class PolicyError(SwarmError, ValueError):
    """A policy that cannot be had or went wrong; one line names it and says where."""


class Seen(NamedTuple):
    """What a policy may look at: one row per hosted drone (a process on a drone hosts one, a simulation many).

    tick: 10 ms each. me: (A,) agent numbers. awake: (A,) rows to act for; the others' answers are ignored.
    position, velocity, target_position, target_velocity: (A, 2) own and the virtual target's; common local frame, m and m/s.
    chain_error, slot_error: (A, 2) target minus position [m] (agent.observation.aim).
    observation: (A, 18) the paper's X_i. memory: neighbours, obstacles and what neighbours' frames said. arrays: all of these as
    one object for compiled policies (agent.tick_arrays).
    """

    tick: int
    me: NDArray[np.int64]
    awake: NDArray[np.bool_]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    target_position: NDArray[np.float64]
    target_velocity: NDArray[np.float64]
    chain_error: NDArray[np.float64]
    slot_error: NDArray[np.float64]
    observation: NDArray[np.float64]
    memory: Memory
    arrays: TickArrays


class Policy(Protocol):
    """Decides accelerations. The safety filter and the limits come after it.

    A policy may have more, and is then told more (agent.core): ``open()``, before the first tick and only in a process that
    forks no other, is the place to open what must not be forked; ``forget(row)`` says that a row's drone was restarted.
    ``files``, paths of what besides its code decides what it does, tell evaluations apart.
    """

    def act(self, seen: Seen) -> NDArray[np.float64]:
        """Wanted acceleration of every row, (A, 2) m/s^2."""
        ...
