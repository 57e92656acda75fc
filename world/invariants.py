"""The invariants: what must hold among the drones' accounts of the slots, checked during every flight.

    permutation  every view gives every slot to exactly one drone, and to its owner the slot it says it holds
    own slot     what a drone says of its own slot is the same in all that it says
    agreement    drones that know the same swaps (equal digests) have equal views
    no livelock  in no second are there more swaps than a drone, or all drones together, may make, given their cooldown
    counts       what a drone counts never falls, nor rises by more than can happen in a tick

One drone that errs or lies must not end the flight of the others. A drone whose own account is impossible is discredited. Where
drones contradict each other the smaller party is; while both are equally large nobody can tell who is wrong, and nobody is. The
first breach is kept with the tick, the drones and the views, and breaks the run (world.outcome.as_broken).

Measured besides: how long after the last fault all living drones had the same view again, how long after it they could have had
one if every frame that arrived had told all its sender knew (world.medium.information_bound), and how many swaps were undone by
a merge.
"""

import math
from collections import Counter, defaultdict, deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import TICK_S, TICKS_PER_S
from protocols.slots.history import is_permutation
from protocols.slots.written import unpack_slots
from protocols.wire.messages import MAX_HEARD
from protocols.wire.status import SWAP_COUNTS, AgentStatus

_COMMITTED, _VACATED, _UNDONE = (SWAP_COUNTS.index(name) for name in ("committed", "vacated", "undone"))
_IN_A_TICK = 2 * MAX_HEARD  # no count rises by more: nothing is counted more than twice per frame heard
_REMEMBERED = 256  # accounts of one drone that are held against those of others

Discredited = list[tuple[int, str]]  # drones, and why


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


class _Views:
    """What those believe that know the same swaps: ``of`` drone -> view, and how many believe each."""

    def __init__(self) -> None:
        self.of: dict[int, bytes] = {}
        self.votes: Counter[bytes] = Counter()

    def put(self, agent: int, view: bytes) -> None:
        """This drone believes this."""
        if (before := self.of.get(agent)) is not None:
            self._withdraw(before)
        self.of[agent] = view
        self.votes[view] += 1

    def drop(self, agent: int) -> None:
        """What this drone believes counts no more."""
        if (view := self.of.pop(agent, None)) is not None:
            self._withdraw(view)

    def _withdraw(self, view: bytes) -> None:
        self.votes[view] -= 1
        if not self.votes[view]:
            del self.votes[view]


class Invariants:
    """Collects the views of N drones as they change.

    says: (N,) the slot that each told of last, or began in.
    """

    def __init__(self, initial_slots: NDArray[np.int16], cooldown_s: float) -> None:
        """Watch a swarm that starts in ``initial_slots`` (N,) and in which a drone pauses ``cooldown_s`` after a swap."""
        agents = len(initial_slots)
        self._agents = agents
        self._initial, self.says = initial_slots, initial_slots.astype(np.int64)
        self._status: dict[int, AgentStatus] = {}
        self._views_of: defaultdict[int, _Views] = defaultdict(_Views)  # by digest
        self._told: defaultdict[int, deque[int]] = defaultdict(deque)  # by drone: the digests of its accounts
        # By drone: its last account since it began and the tick of that; (tick, swaps) that it made lately.
        self._account: dict[int, tuple[int, AgentStatus]] = {}
        self._made_lately: defaultdict[int, deque[tuple[int, int]]] = defaultdict(deque)
        self._made = self._swaps = 0  # swaps that all accounts tell of: now, and at the last tick
        self._recent: deque[tuple[int, int]] = deque()
        self._most = 0
        # Both parties pause, so N drones make N/2 swaps a cooldown; each may besides close the ranks once.
        self._bound = agents * (1 + math.ceil(1 / cooldown_s))
        self._own_bound = agents + math.ceil(1 / cooldown_s)  # one drone: it may close the ranks often
        self._changed = False
        self._calm = False  # whether nothing but an account, a fault or a death can change what `tick` sees
        self._living = agents
        self._differ = False
        self._differ_ticks = 0
        self._last_fault = 0
        self._agreed_at: int | None = None
        self._allowed_at: int | None = None
        self._news: list[tuple[int, int]] = []  # (drone, tick) of swaps of which not all could know
        self.breach: str | None = None

    def see(self, tick: int, agent: int, status: AgentStatus) -> Discredited:
        """A drone's account at this tick; returns who is discredited by it. An impossible account counts for nothing."""
        wrong = self._impossible(tick, agent, status)
        if wrong:
            return [self._discredit(tick, agent, *wrong)]
        self._changed = True
        before = self._status.get(agent)
        made = _made(status) - (_made(before) if before else 0)
        self._made += made
        if made > 0:
            self._news.append((agent, tick))
            self._made_lately[agent].append((tick, made))
        self._status[agent] = status
        self._account[agent] = tick, status
        self.says[agent] = status.slot
        return self._compare(tick, agent, status)

    def may_be(self, tick: int, agent: int, status: AgentStatus) -> bool:
        """Whether a drone's last account, given after this tick, can be true. It is held against nobody any more."""
        return self._impossible(tick, agent, status) is None

    def claims(self, tick: int, claim: NDArray[np.int64], flying: NDArray[np.bool_]) -> Discredited:
        """The slots (N,) that drones say they hold at this tick; returns who of those that fly gave another account of itself."""
        wrong = np.flatnonzero((claim != self.says) & flying).tolist()
        return [
            self._discredit(
                tick, agent, "own slot", f"says it holds slot {claim[agent]} and told of {self.says[agent]}"
            )
            for agent in wrong
        ]

    def renew(self, agent: int) -> None:
        """This drone begins anew, knowing nothing: its counts and its slot are what they were at the start."""
        self._account.pop(agent, None)
        self.says[agent] = self._initial[agent]

    def lose(self, agent: int) -> None:
        """What this drone told counts for nothing any more."""
        for digest in self._told.pop(agent, ()):
            self._withdraw(agent, digest)

    def _withdraw(self, agent: int, digest: int) -> None:
        views = self._views_of[digest]
        views.drop(agent)
        if not views.of:
            del self._views_of[digest]

    def _discredit(self, tick: int, agent: int, rule: str, how: str) -> tuple[int, str]:
        self.breach = self.breach or f"{rule} broken at tick {tick}: agent {agent} {how}"
        self.lose(agent)
        return agent, f"its account of itself cannot be true: it {how}"

    def _impossible(self, tick: int, agent: int, status: AgentStatus) -> tuple[str, str] | None:
        """What is wrong with this account by itself: the rule it breaks, and how."""
        since, before = self._account.get(agent, (-1, None))
        if not before or (status.view, status.slot) != (before.view, before.slot):  # those were looked at
            view = unpack_slots(status.view, self._agents)
            if not is_permutation(view):
                return "permutation", f"believes {view.tolist()}"
            if view[agent] != status.slot:
                return "own slot", f"says it holds slot {status.slot} and believes {view.tolist()}"
        if status.heard >= self._agents:
            return "counts", f"hears {status.heard} others"
        numbers = (*status.swaps, *status.rejected)
        counted = (*before.swaps, *before.rejected) if before else (0,) * len(numbers)
        most = _IN_A_TICK * (tick - since + 1)
        for was, now in zip(counted, numbers, strict=True):
            if not was <= now <= was + most:
                return "counts", f"counts {now} after {was}"
        if before:
            lately = self._made_lately[agent]
            while lately and lately[0][0] <= tick - TICKS_PER_S:
                lately.popleft()
            swaps = _made(status) - _made(before) + sum(made for _, made in lately)
            if swaps > self._own_bound:
                return "pauses", f"makes {swaps} swaps within a second"
        return None

    def _compare(self, tick: int, agent: int, status: AgentStatus) -> Discredited:
        """Hold a possible account against those of others who know the same."""
        views, told = self._views_of[status.digest], self._told[agent]
        if agent not in views.of:
            told.append(status.digest)
            if len(told) > _REMEMBERED:
                self._withdraw(agent, told.popleft())
        views.put(agent, status.view)
        if len(views.votes) == 1:
            return []
        (most, votes), (_, others) = views.votes.most_common(2)
        if votes == others:
            return []
        outvoted = [other for other, view in views.of.items() if view != most]
        first = next(other for other, view in views.of.items() if view == most)
        return [
            self._discredit(
                tick,
                other,
                "agreement",
                f"knows what agent {first} knows but believes {list(views.of[other])}",
            )
            for other in outvoted
        ]

    def _undecided(self) -> str | None:
        """A contradiction of which nobody can tell who is wrong."""
        for views in self._views_of.values():
            first, *others = views.of.items()
            for other, view in others:
                if view != first[1]:
                    return (
                        f"agreement broken: agents {first[0]} and {other} know the same swaps but believe "
                        f"{list(first[1])} and {list(view)}"
                    )
        return None

    def fault(self, tick: int) -> None:
        """Something was done to the swarm at this tick."""
        self._last_fault, self._calm = tick, False
        self._agreed_at = self._allowed_at = None

    def tick(self, tick: int, living: list[int], could_know: NDArray[np.int32] | None = None) -> None:
        """Once per tick, after all accounts: ``living`` are the drones that fly and answer, ``could_know`` as WorldCore's."""
        if self._calm and not self._changed and len(living) == self._living:
            return
        self._calm = False
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
            known = could_know is None or not self._news
            self._calm = known and not self._differ
            return
        self._changed = False
        if self._made > self._swaps:
            self._recent.append((tick, self._made - self._swaps))
        self._swaps = self._made
        while self._recent and self._recent[0][0] <= tick - TICKS_PER_S:
            self._recent.popleft()
        in_a_second = sum(count for _, count in self._recent)
        self._most = max(self._most, in_a_second)
        if in_a_second > self._bound and not self.breach:
            self.breach = f"livelock at tick {tick}: {in_a_second} swaps within one second, at most {self._bound} are possible"

    @property
    def one_view(self) -> bool:
        """Whether all living drones have the same view now."""
        return not self._differ

    def result(self) -> Watched:
        """What was seen so far."""
        return Watched(
            breach=self.breach or self._undecided(),
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
