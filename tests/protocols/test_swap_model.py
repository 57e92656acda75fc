"""Random schedules against the omniscient oracle of `swap_net`.

Three to six agents propose, close ranks, speak, die, come back, forget, drift apart and meet again; every
frame may be lost, doubled, delayed or overtaken. The oracle checks every party after every step. At the end
all faults heal, and then, in a full mesh or in a line,

    all views are equal within `rounds_to_agree` rounds (one broadcast of each agent per round);
    no deal is left after the longest time-out;
    everything is settled, and every note is quiet, within a further `rounds_to_settle`.

By default 200 schedules; with RSC_SWARM_DEEP=1, 10,000.
"""

from __future__ import annotations

import os
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from swap_net import QUICK, Swarm

from protocols.slots.agreement import Stance

DEEP = os.environ.get("RSC_SWARM_DEEP") == "1"
agents = st.integers(0, 5)
indices = st.integers(0, 1000)


def rounds_to_agree(swarm: Swarm, diameter: int) -> int:
    """Pending proposals end first. Then, per hop: a frame to show the digest, and the swaps of both sides in rotation, in
    each frame one of the settled ones."""
    rules = swarm.rules
    swaps = max(party.book.count for party in swarm.living) * 2 + swarm.n
    per_hop = 3 + swaps
    return rules.answer_ticks + 1 + diameter * per_hop


def rounds_to_settle(swarm: Swarm, diameter: int) -> int:
    """After at most `ack_ticks` of silence, who has had the swaps travels out, and that all have, back."""
    return swarm.rules.ack_ticks + 2 * diameter + 1


class SwapSchedules(RuleBasedStateMachine):
    @initialize(n=st.integers(3, 6), history_max=st.sampled_from([4, 512]))
    def start(self, n: int, history_max: int) -> None:
        self.swarm = Swarm(n, replace(QUICK, history_max=history_max))

    @rule(agent=agents, partner=agents)
    def propose(self, agent: int, partner: int) -> None:
        if {agent % self.swarm.n} <= self.swarm.alive:
            self.swarm.propose(agent % self.swarm.n, partner % self.swarm.n)

    @rule(agent=agents, partner=agents)
    def agree(self, agent: int, partner: int) -> None:
        """Two in reach come to terms, and so far only the proposer knows."""
        agent, partner = agent % self.swarm.n, (agent + 1 + partner % (self.swarm.n - 1)) % self.swarm.n
        self.swarm.wait(self.swarm.rules.cooldown_ticks)
        both_there = {agent, partner} <= self.swarm.alive and (agent, partner) in self.swarm.links
        if both_there and not self.swarm.propose(agent, partner):
            self.swarm.whisper(agent, partner)
            self.swarm.whisper(partner, agent)

    @rule(agent=agents, dead=agents)
    def close_ranks(self, agent: int, dead: int) -> None:
        agent, dead = agent % self.swarm.n, dead % self.swarm.n
        if agent in self.swarm.alive and dead not in self.swarm.alive:
            self.swarm.vacate(agent, dead)

    @rule(agent=agents, listener=agents)
    def whisper(self, agent: int, listener: int) -> None:
        """A frame that only one hears."""
        agent, listener = agent % self.swarm.n, listener % self.swarm.n
        if {agent, listener} <= self.swarm.alive and (agent, listener) in self.swarm.links:
            self.swarm.whisper(agent, listener)

    @rule(agent=agents)
    def say(self, agent: int) -> None:
        if agent % self.swarm.n in self.swarm.alive and len(self.swarm.air) < 40:
            self.swarm.say(agent % self.swarm.n)

    @precondition(lambda self: self.swarm.air)
    @rule(index=indices, double=st.booleans())
    def deliver(self, index: int, double: bool) -> None:
        self.swarm.deliver(index % len(self.swarm.air), keep=double)

    @precondition(lambda self: self.swarm.air)
    @rule(index=indices)
    def lose(self, index: int) -> None:
        self.swarm.drop(index % len(self.swarm.air))

    @rule(ticks=st.integers(1, 9))
    def wait(self, ticks: int) -> None:
        self.swarm.wait(ticks)

    @rule()
    def everybody_once(self) -> None:
        self.swarm.round()

    @rule(cut=st.integers(1, 5))
    def drift_apart(self, cut: int) -> None:
        self.swarm.part([range(cut % self.swarm.n), range(cut % self.swarm.n, self.swarm.n)])

    @rule()
    def meet(self) -> None:
        self.swarm.heal()

    @rule(agent=agents)
    def die(self, agent: int) -> None:
        agent %= self.swarm.n
        if self._keepers_besides(agent):
            self.swarm.kill(agent)

    @rule(agent=agents)
    def come_back(self, agent: int) -> None:
        self.swarm.revive(agent % self.swarm.n)

    @rule(agent=agents)
    def restart(self, agent: int) -> None:
        agent %= self.swarm.n
        if self._keepers_besides(agent):
            self.lossless = False  # what it alone knew is gone
            self.swarm.restart(agent)

    def _keepers_besides(self, agent: int) -> bool:
        """Whether there still are the two who must tell an amnesiac where everybody is."""
        parties = enumerate(self.swarm.endpoints)
        keepers = [i for i, party in parties if party.stance is not Stance.AMNESIAC and i in self.swarm.alive]
        return len({*keepers} - {agent, self.swarm.liar}) >= 2

    @invariant()
    def views_agree_where_knowledge_does(self) -> None:
        if hasattr(self, "swarm"):
            views = {}
            for party in self.swarm.endpoints:
                assert views.setdefault(party.digest, party.slot_of) == party.slot_of

    def teardown(self) -> None:
        if not hasattr(self, "swarm"):
            return
        swarm = self.swarm
        swarm.air.clear()
        for agent in range(swarm.n):
            swarm.revive(agent)
        survivors = frozenset().union(*swarm.oracle.known)
        diameter = 1
        if swarm.tick % 2 and all(party.stance is not Stance.AMNESIAC for party in swarm.endpoints):
            diameter = swarm.n - 1
            swarm.line_up()
        else:
            swarm.heal()
        for count in range(rounds_to_agree(swarm, diameter)):
            pending = count <= swarm.rules.answer_ticks
            if pending or len({party.digest for party in swarm.endpoints}) > 1:
                swarm.round()
        assert len({party.slot_of for party in swarm.endpoints}) == 1, "views differ after healing"
        assert len({party.digest for party in swarm.endpoints}) == 1, "knowledge differs after healing"
        assert survivors <= swarm.oracle.known[0], "a swap got lost"
        swarm.wait(swarm.rules.lock_ticks)
        assert all(party.stance is Stance.IDLE for party in swarm.endpoints), "a deal outlived its time-out"
        for _ in range(rounds_to_settle(swarm, diameter)):
            swarm.round()
        assert all(party.quiet for party in swarm.endpoints), "something is still open"


SwapSchedules.TestCase.settings = settings(
    max_examples=10_000 if DEEP else 200,
    stateful_step_count=60 if DEEP else 40,
    deadline=None,
    derandomize=not DEEP,
    suppress_health_check=list(HealthCheck),
)
TestSwapSchedules = pytest.mark.timeout(7200 if DEEP else 300)(SwapSchedules.TestCase)
