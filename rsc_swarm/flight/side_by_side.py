"""Many drones of one flight in parts, each flown by a thread of its own.

What a drone does depends on nothing but its own row, so a flight is the same in however many parts. Most of a tick is machine
code, beside which other threads may run; what is Python, the slot protocol above all, they do one after the other.
"""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from agent.core import AgentCore, Inputs, Outputs
from agent.policy import find_policy
from agent.policy.base import Compiled
from protocols.kernels import others_may_run
from protocols.mission.document import Mission
from protocols.wire.sensed import Sensed
from protocols.wire.status import AgentStatus

_WORTHWHILE = 256  # drones of a thread; fewer cost less than to wake it


def threads_for(agents: int) -> int:
    """How many threads so many drones are best flown by, on the processors that there are."""
    return max(1, min(len(os.sched_getaffinity(0)), agents // _WORTHWHILE))


def drones_of(
    mission: Mission, me: Sequence[int], initial_slots: NDArray[np.int16], rehearsal: bool, threads: int
) -> "AgentCore | SideBySide":
    """The drones of an `AgentCore`, in parts where there are several threads. A policy that is not compiled code flies in one
    part: whoever wrote it need not have thought of threads, and they would gain nothing.

    Raises:
        agent.policy.PolicyError: as AgentCore.
    """
    if threads > 1 and not isinstance(find_policy(mission.policy, mission.told), Compiled):
        threads = 1
    bounds = [len(me) * part // threads for part in range(threads + 1)]
    parts = [slice(first, end) for first, end in pairwise(bounds)]
    cores = [AgentCore(mission, me[rows], initial_slots[rows], rehearsal=rehearsal) for rows in parts]
    return cores[0] if threads == 1 else SideBySide(cores, parts)


class SideBySide:
    """What an `AgentCore` of all drones is to a simulation."""

    def __init__(self, cores: Sequence[AgentCore], parts: Sequence[slice]) -> None:
        """Fly each core's drones, which are these rows of all, by a thread of its own."""
        self._cores, self._parts, rows = cores, parts, parts[-1].stop
        self._core_of = [core for core, part in zip(cores, parts, strict=True) for _ in range(rows)[part]]
        self._first = [part.start for part in parts for _ in range(rows)[part]]
        self._threads = ThreadPoolExecutor(len(cores), "drones")
        self._inputs: Inputs | None = None
        self._shares: list[Inputs] = []
        self._said = Outputs(np.zeros((rows, 2)), np.zeros(rows, np.bool_), np.zeros(rows, np.int64), ())

    def restart(self, row: int, tick: int, boot: int) -> None:
        """As `AgentCore.restart`."""
        self._core_of[row].restart(row - self._first[row], tick, boot)

    def status(self, row: int, tick: int, rejected: tuple[int, ...]) -> AgentStatus:
        """As `AgentCore.status`."""
        return self._core_of[row].status(row - self._first[row], tick, rejected)

    def plans(self, tick: int) -> NDArray[np.float32] | None:
        """As `AgentCore.plans`."""
        plans = [made for core in self._cores if (made := core.plans(tick)) is not None]
        return np.concatenate(plans) if plans else None

    def tick(self, tick: int, inputs: Inputs, first: int) -> Outputs:
        """As `AgentCore.tick`.

        Raises:
            agent.policy.PolicyError: as there; of several, that of the lowest row.
        """

        def decide(core: AgentCore, share: Inputs, part: slice) -> Outputs:
            return core.tick(tick, share, first + part.start)

        if inputs is not self._inputs:
            self._inputs, self._shares = inputs, [_share(inputs, part) for part in self._parts]
            answers = [*map(decide, self._cores, self._shares, self._parts)]  # what must be compiled is, once
        else:
            shares = zip(self._cores, self._shares, self._parts, strict=True)
            with others_may_run():
                wait(deciding := [self._threads.submit(decide, *share) for share in shares])
            answers = [decided.result() for decided in deciding]
        command, sent, slot, _ = said = self._said
        changed: list[int] = []
        for part, answer in zip(self._parts, answers, strict=True):
            command[part], sent[part], slot[part], _ = answer
            changed += [part.start + row for row in answer.changed]
        return said._replace(changed=tuple(changed))


def _share(inputs: Inputs, rows: slice) -> Inputs:
    """What reaches these drones, in the same arrays."""
    sensed = Sensed._make(array[rows] for array in inputs.sensed)
    start = inputs.start[rows.start : rows.stop + 1]
    return Inputs(inputs.awake[rows], sensed, inputs.air, start, inputs.heard)
