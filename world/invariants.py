"""The invariants: what must hold among the drones' views of the slots, checked during every flight.

    permutation  every view gives every slot to exactly one drone
    agreement    drones that know the same swaps (equal digests) have equal views
    no livelock  in no second are there more swaps than all drones together may make, given their cooldown

A breach is kept with the tick, the drones and the two views, and fails the flight. Measured besides: how long after the
last fault all living drones had the same view again, how long after it they could have had one if every frame that arrived
had told all its sender knew (world.medium.information_bound), and how many swaps were undone by a merge.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import TICK_S
from protocols.wire.status import SWAP_COUNTS, AgentStatus

_SECOND = round(1 / TICK_S)
_COMMITTED, _VACATED, _UNDONE = (SWAP_COUNTS.index(name) for name in ("committed", "vacated", "undone"))


@dataclass(frozen=True)
class Watched:
    """What was seen of them in one flight. agreed_after_s: seconds from the last fault (or the start) to the first moment at
    which all living drones had one view; None if there was none. allowed_after_s: the same, had every frame told all; None also
    where nobody looked. agreed: whether they had one view at the end."""

    breach: str | None
    views_differ_s: float
    agreed_after_s: float | None
    allowed_after_s: float | None
    agreed: bool
    most_swaps_in_a_second: int
    undone: int


class Invariants:
    """Collects the views of N drones as they change."""

    def __init__(self, agents: int, cooldown_s: float) -> None:
        """Watch a swarm of ``agents`` that pause ``cooldown_s`` after a swap."""
        self._everyone = list(range(agents))
        self._status: dict[int, AgentStatus] = {}
        self._view_of: dict[int, tuple[bytes, int]] = {}
        self._swaps = 0
        self._recent: deque[tuple[int, int]] = deque()
        self._most = 0
        # Both parties pause, so N drones make N/2 swaps a cooldown; each may besides close the ranks once.
        self._bound = agents * (1 + math.ceil(1 / cooldown_s))
        self._changed = False
        self._living = agents
        self._differ = False
        self._differ_ticks = 0
        self._last_fault = 0
        self._agreed_at: int | None = None
        self._allowed_at: int | None = None
        self._news: list[tuple[int, int]] = []  # (drone, tick) of swaps of which not all could know
        self.breach: str | None = None

    def see(self, tick: int, agent: int, status: AgentStatus) -> None:
        """A drone's account at this tick; keeps the first breach."""
        self._changed = True
        before = self._status.get(agent)
        if _made(status) > (_made(before) if before else 0):
            self._news.append((agent, tick))
        self._status[agent] = status
        if self.breach:
            return
        view = list(status.view)
        if sorted(view) != self._everyone:
            self.breach = f"permutation broken at tick {tick}: agent {agent} believes {view}"
            return
        known, first = self._view_of.setdefault(status.digest, (status.view, agent))
        if known != status.view:
            self.breach = (
                f"agreement broken at tick {tick}: agents {first} and {agent} know the same swaps but believe "
                f"{list(known)} and {view}"
            )

    def fault(self, tick: int) -> None:
        """Something was done to the swarm at this tick."""
        self._last_fault = tick
        self._agreed_at = self._allowed_at = None

    def tick(self, tick: int, living: list[int], could_know: NDArray[np.int32] | None = None) -> None:
        """Once per tick, after all accounts: ``living`` are the drones that fly and answer, ``could_know`` as WorldCore's."""
        if could_know is not None:
            self._news = [news for news in self._news if not _equal(could_know[living, news[0]], news[1])]
            if self._allowed_at is None and not self._news:
                self._allowed_at = tick
        if self._changed or len(living) != self._living:
            views = {self._status[agent].view for agent in living if agent in self._status}
            self._differ = len(views) > 1
            self._living = len(living)
        if self._differ:
            self._differ_ticks += 1
        elif self._agreed_at is None:
            self._agreed_at = tick
        if not self._changed and not self._recent:
            return
        self._changed = False
        total = sum(_made(status) for status in self._status.values())
        if total > self._swaps:
            self._recent.append((tick, total - self._swaps))
        self._swaps = total
        while self._recent and self._recent[0][0] <= tick - _SECOND:
            self._recent.popleft()
        in_a_second = sum(count for _, count in self._recent)
        self._most = max(self._most, in_a_second)
        if in_a_second > self._bound and not self.breach:
            self.breach = f"livelock at tick {tick}: {in_a_second} swaps within one second, at most {self._bound} are possible"

    def result(self) -> Watched:
        """What was seen so far."""
        return Watched(
            breach=self.breach,
            views_differ_s=self._differ_ticks * TICK_S,
            agreed_after_s=self._since_fault(self._agreed_at),
            allowed_after_s=self._since_fault(self._allowed_at),
            agreed=not self._differ,
            most_swaps_in_a_second=self._most,
            undone=sum(status.swaps[_UNDONE] for status in self._status.values()),
        )

    def _since_fault(self, tick: int | None) -> float | None:
        return None if tick is None else round((tick - self._last_fault) * TICK_S, 2)


def _made(status: AgentStatus) -> int:
    return status.swaps[_COMMITTED] + status.swaps[_VACATED]


def _equal(latest: NDArray[np.int32], tick: int) -> bool:
    """Whether all could know of what was done at this tick, or nobody."""
    told = latest >= tick
    return bool(told.all() or not told.any())
