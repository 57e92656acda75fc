"""Random schedules in which one party says anything: what the honest keep.

All that `test_swap_model` does happens here too, to four to eight agents, one of which lies at any moment, to one or to
all, in all the ways of `swap_liar`. `swap_net`'s oracle checks every honest party after every step. At the end, while the liar
goes on telling all that it has, the honest, in a full mesh or in a line,

    have equal views within `rounds_to_agree` rounds, and have lost no swap that two had agreed to;
    are bound to nothing but to the liar, and to it for two promises at most;
    can still agree to a swap.

By default 40 schedules; with RSC_SWARM_DEEP=1, 10,000.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import initialize, rule
from swap_liar import LIES, Liar
from swap_net import QUICK, Swarm
from test_swap_model import DEEP, SwapSchedules, agents, rounds_to_agree

from protocols.slots.agreement import SlotParty, Stance

numbers = st.tuples(st.integers(0, 999), st.integers(0, 999), st.integers(0, 999))


class LiarSchedules(SwapSchedules):
    @initialize(n=st.integers(4, 8), history_max=st.just(512), liar=agents)
    def start(self, n: int, history_max: int, liar: int) -> None:  # type: ignore[override]
        self.swarm = Swarm(n, QUICK, liar=liar % n)
        self.liar = Liar(self.swarm)

    @rule(kind=st.sampled_from(LIES), choice=numbers, listener=st.integers(0, 15))
    def lie(self, kind: str, choice: tuple[int, int, int], listener: int) -> None:
        """To one, or to all."""
        note = self.liar.lie(kind, choice)
        self.swarm.lie(note, [listener] if listener < self.swarm.n else range(self.swarm.n))

    @rule(agent=agents)
    def eavesdrop(self, agent: int) -> None:
        agent %= self.swarm.n
        if agent in self.swarm.alive and len(self.swarm.air) < 40:
            self.liar.hear(self.swarm.say(agent))

    @rule(partner=agents, later=st.booleans())
    def deal_with_the_liar(self, partner: int, later: bool) -> None:
        """It asks, is given a consent, and uses it at once or not yet."""
        self.swarm.wait(self.swarm.rules.cooldown_ticks)
        choice = (partner, 1, 4)
        self.swarm.lie(self.liar.lie("ask", choice), range(self.swarm.n))
        self.liar.listen()
        if self.liar.consents and not later:
            self.swarm.lie(self.liar.lie("cash in", (len(self.liar.consents) - 1, 1, 4)), range(self.swarm.n))

    def _honest(self) -> Iterator[SlotParty]:
        return iter(self.swarm.honest)

    def views_agree_where_knowledge_does(self) -> None:
        views: dict[int, tuple[int, ...]] = {}
        if hasattr(self, "swarm"):
            for party in self._honest():
                assert views.setdefault(party.digest, party.slot_of) == party.slot_of

    def teardown(self) -> None:
        if not hasattr(self, "swarm"):
            return
        swarm, liar = self.swarm, self.swarm.liar
        assert liar is not None
        swarm.air.clear()
        for agent in range(swarm.n):
            swarm.revive(agent)
        swarm.kill(liar)  # its puppet says no more; it says this:
        last_words = [
            self.liar.lie("had", (agent, 1, 4))._replace(ops=tuple(self.liar.made[at::4][:16]))
            for at, agent in enumerate((0, 1, 2, 3))
        ]
        agreed = {op for known in swarm.oracle.known for op in known if not op.taken}
        diameter = 1
        if swarm.tick % 2 and all(party.stance is not Stance.AMNESIAC for party in self._honest()):
            diameter = swarm.n
            honest = [party.me for party in self._honest()]
            swarm.links = {pair for a, b in pairwise(honest) for pair in ((a, b), (b, a))}
        else:
            swarm.heal()
        self._rounds(rounds_to_agree(swarm, diameter) + 16 * len(self.liar.made), last_words)
        assert len({party.digest for party in self._honest()}) == 1, "knowledge differs after healing"
        assert len({party.slot_of for party in self._honest()}) == 1, "views differ after healing"
        for party in self._honest():
            assert agreed <= set(party.book.ops), "a swap got lost"
        swarm.wait(swarm.rules.lock_ticks)
        assert all(party.stance is Stance.IDLE for party in self._honest()), "a deal outlived its time-out"
        self._can_still_agree(last_words)

    def _rounds(self, count: int, words: list) -> None:  # type: ignore[type-arg]
        for at in range(count):
            self.swarm.round()
            note = words[at % len(words)]
            self.swarm.lie(note._replace(digest=at), range(self.swarm.n))

    def _can_still_agree(self, words: list) -> None:  # type: ignore[type-arg]
        swarm = self.swarm
        a, b = [party.me for party in self._honest()][:2]
        if (a, b) in swarm.links:
            before = swarm.endpoints[a].counts.committed
            assert not swarm.propose(a, b)
            self._rounds(4, words)
            assert swarm.endpoints[a].counts.committed == before + 1, "the honest cannot agree any more"


LiarSchedules.TestCase.settings = settings(
    max_examples=10_000 if DEEP else 40,
    stateful_step_count=60 if DEEP else 40,
    deadline=None,
    derandomize=not DEEP,
    suppress_health_check=list(HealthCheck),
)
TestLiarSchedules = pytest.mark.timeout(14400 if DEEP else 300)(LiarSchedules.TestCase)
