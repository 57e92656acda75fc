"""A tiny radio network for swap parties, and an oracle that knows all swaps and checks all parties each step.

Nothing happens by itself: the test says who speaks, which frame arrives, is lost or arrives twice, and when
time passes. Frames go through the codec and msgpack, as on the air.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from hashlib import blake2b
from struct import pack
from typing import NamedTuple

import msgpack

from protocols.slots.agreement import IllegalSwap, SlotNote, SlotParty, Stance, SwapRules, decode, encode
from protocols.slots.history import Swap

QUICK = SwapRules(
    cooldown_ticks=3,
    answer_ticks=4,
    lock_ticks=8,
    retry_ticks=1,
    repair_per_frame=2,
    repair_frames=2,
    ack_ticks=5,
)
"""Short times, so that short schedules reach every rule."""


class Packet(NamedTuple):
    """One frame on its way to one listener."""

    src: int
    dst: int
    note: SlotNote


class Swarm:
    """N parties, the air between them, and a clock that the test advances.

    `liar` says whatever the test makes it say (`lie`); nothing is asked of it.
    """

    def __init__(self, n: int, rules: SwapRules = QUICK, liar: int | None = None) -> None:
        self.n, self.rules, self.tick, self.liar = n, rules, 0, liar
        self.endpoints = [SlotParty(agent, range(n), rules) for agent in range(n)]
        self.boots = [0] * n
        self.alive = set(range(n))
        self.links = {(a, b) for a in range(n) for b in range(n) if a != b}
        self.air: list[Packet] = []
        self.oracle = Oracle(self)

    @property
    def honest(self) -> list[SlotParty]:
        return [party for agent, party in enumerate(self.endpoints) if agent != self.liar]

    @property
    def living(self) -> list[SlotParty]:
        return [self.endpoints[agent] for agent in sorted(self.alive)]

    def propose(self, agent: int, partner: int) -> str:
        """Empty if the proposal was made, else why not."""
        return self._try(agent, lambda party: party.propose(partner, self.tick))

    def vacate(self, agent: int, dead: int) -> str:
        return self._try(agent, lambda party: party.vacate(dead, self.tick))

    def say(self, agent: int) -> SlotNote:
        """One broadcast: a frame to everyone in reach is now in the air."""
        note = self.endpoints[agent].note(self.tick)
        note = decode(msgpack.unpackb(msgpack.packb(encode(note))), self.n)
        self.air += [Packet(agent, other, note) for other in range(self.n) if (agent, other) in self.links]
        return note

    def lie(self, note: SlotNote, listeners: Iterable[int]) -> None:
        """The liar says this, to these only, whom it reaches at once; what cannot be said is not heard."""
        assert self.liar is not None
        try:
            note = decode(msgpack.unpackb(msgpack.packb(encode(note))), self.n)
        except (ValueError, OverflowError):
            return
        for listener in listeners:
            if listener in self.alive and listener != self.liar:
                self.endpoints[listener].hear(note, self.liar, self.tick)
                self.oracle.look()

    def whisper(self, agent: int, listener: int) -> None:
        """One broadcast that only `listener` hears, at once."""
        before = len(self.air)
        self.say(agent)
        spoken, self.air = self.air[before:], self.air[:before]
        self.air += [packet for packet in spoken if packet.dst == listener]
        if len(self.air) > before:
            self.deliver(before)

    def deliver(self, index: int, keep: bool = False) -> None:
        """A frame arrives; `keep` leaves a double of it in the air."""
        src, dst, note = self.air[index] if keep else self.air.pop(index)
        if dst in self.alive:
            self.endpoints[dst].hear(note, src, self.tick)
            self.oracle.look()

    def drop(self, index: int) -> None:
        del self.air[index]

    def wait(self, ticks: int) -> None:
        for _ in range(ticks):
            self.tick += 1
            for party in self.living:
                party.advance(self.tick)
        self.oracle.look()

    def round(self) -> None:
        """One tick in which all living broadcast once and all in reach hear it; older frames stay."""
        self.wait(1)
        old, self.air = self.air, []
        for agent in sorted(self.alive):
            self.say(agent)
        while self.air:
            self.deliver(0)
        self.air = old

    def part(self, groups: Sequence[Iterable[int]]) -> None:
        """Only members of one group hear each other; frames already in the air still arrive."""
        group_of = {agent: i for i, group in enumerate(groups) for agent in group}
        pairs = [(a, b) for a in range(self.n) for b in range(self.n) if a != b]
        self.links = {(a, b) for a, b in pairs if group_of.get(a, a + self.n) == group_of.get(b, b + self.n)}

    def line_up(self) -> None:
        """Each agent hears only those numbered next to it."""
        self.links = {(a, b) for a in range(self.n) for b in range(self.n) if abs(a - b) == 1}

    def heal(self) -> None:
        self.part([range(self.n)])

    def kill(self, agent: int) -> None:
        self.alive.discard(agent)

    def revive(self, agent: int) -> None:
        """It was only out of reach or stuck: it remembers everything."""
        self.alive.add(agent)
        self.endpoints[agent].advance(self.tick)

    def restart(self, agent: int) -> None:
        """It remembers nothing but its mission and the number of its boot."""
        self.boots[agent] += 1
        self.endpoints[agent] = SlotParty(
            agent, range(self.n), self.rules, nonce=self.boots[agent], amnesiac=True
        )
        self.oracle.forget(agent)
        self.alive.add(agent)

    def _try(self, agent: int, act: object) -> str:
        party = self.endpoints[agent]
        before = party.state_key()
        try:
            act(party)  # type: ignore[operator]
        except IllegalSwap as refusal:
            assert party.state_key() == before, "an illegal event changed the party"
            return str(refusal)
        self.oracle.look()
        return ""


class Oracle:
    """Knows which swaps each honest party has learned, and holds them to it after every step.

    The view is a permutation, and is what an independent fold of exactly the known swaps gives.
    The digest is the sum over exactly those swaps. What a party has learned it keeps until it restarts, but for slots that
    the liar took too often.
    Both have agreed to a swap, unless it took a slot; the honest take those of the dead only. The honest use no nonce twice.
    A swap of two honest agents that was acted on is undone only if one of them is `exposed`.
    No deal outlasts two promises.
    """

    def __init__(self, swarm: Swarm) -> None:
        self._swarm = swarm
        self.ever: set[Swap] = set()
        self.known: list[frozenset[Swap]] = [frozenset()] * swarm.n
        self.undone = 0
        self._start = swarm.endpoints[0].digest
        self._seen: list[object] = [None] * swarm.n
        self._bound: dict[int, Swap] = {}  # who is promised, and to what
        self._promised: set[tuple[int, Swap]] = set()
        self._lapsed: set[int] = set()  # who gave a promise up
        self._restarted: set[int] = set()

    def forget(self, agent: int) -> None:
        """The agent restarted."""
        self.known[agent], self._seen[agent] = frozenset(), None
        self._restarted.add(agent)

    def look(self) -> None:
        """Check everybody."""
        for agent, party in enumerate(self._swarm.endpoints):
            if agent == self._swarm.liar:
                continue
            self._watch_promises(agent, party)
            signature = (party.book.ops, party.counts.undone)
            if signature != self._seen[agent]:
                self._check(agent, party)
                self._seen[agent] = signature

    def _watch_promises(self, agent: int, party: SlotParty) -> None:
        deal, before = party.deal, self._bound.pop(agent, None)
        if deal is not None and party.stance is Stance.PROMISED:
            self._bound[agent] = deal.swap(deal.counter)
            self._promised.add((agent, self._bound[agent]))
        if before is not None and before != self._bound.get(agent) and before not in party.book:
            self._lapsed.add(agent)
        late = deal is not None and self._swarm.tick > deal.since + 2 * self._swarm.rules.lock_ticks
        assert not late or agent not in self._swarm.alive, "a deal without end"

    def _check(self, agent: int, party: SlotParty) -> None:
        n, liar, before, now = self._swarm.n, self._swarm.liar, self.known[agent], frozenset(party.book.ops)
        self.known[agent] = now
        assert all(op.taken and op.agent_a == liar for op in before - now), "a swap was forgotten"
        assert sorted(party.slot_of) == list(range(n)), "not a permutation"
        slot_of, skipped = fold(now, n)
        assert party.slot_of == slot_of, "the view is not the fold of the swaps"
        assert party.digest == self._digest(now), "the digest is not that of the swaps"
        for op in now - self.ever:
            if op.agent_a != liar:
                assert op in self._swarm.endpoints[op.agent_a].book, f"the proposer never agreed: {op}"
                assert not op.taken or op.agent_b not in self._swarm.alive, f"taken from the living: {op}"
                assert all(old[1:3] != op[1:3] for old in self.ever), "a nonce was used twice"
            if not op.taken and op.agent_b != liar:
                assert (op.agent_b, op) in self._promised, f"the partner never agreed: {op}"
            self.ever.add(op)
        _, skipped_before = fold(before, n) if skipped & before else ((), frozenset())
        for op in skipped & (before - skipped_before):
            self.undone += 1
            exposed = self.exposed(before - skipped_before)
            assert op.taken or exposed & {op.agent_a, op.agent_b}, f"undone among the honest: {op}"

    def exposed(self, acted_on: Iterable[Swap]) -> set[int]:
        """The liar; who ever agreed to a swap with it, gave up a promise, restarted, or agreed to a swap from a slot into which a
        vacancy had brought it; and whoever swapped with one of these."""
        found = {*self._lapsed, *self._restarted, *([] if self._swarm.liar is None else [self._swarm.liar])}
        found |= {agent for agent, op in self._promised if op.agent_a == self._swarm.liar}
        agreed = sorted(op for op in acted_on if not op.taken)
        at = list(range(self._swarm.n))
        for op in agreed:
            for who, slot, other in ((op.agent_a, op.slot_a, op.slot_b), (op.agent_b, op.slot_b, op.slot_a)):
                if at[who] != slot:
                    found.add(who)
                at[who] = other
        pairs = [{op.agent_a, op.agent_b} for op in agreed]
        while more := {who for pair in pairs if found & pair for who in pair} - found:
            found |= more
        return found

    def _digest(self, ops: Iterable[Swap]) -> int:
        hashes = (int.from_bytes(blake2b(pack("<7q", *op), digest_size=8).digest(), "little") for op in ops)
        return (self._start + sum(hashes)) % 2**64


def fold(ops: Iterable[Swap], n: int) -> tuple[tuple[int, ...], frozenset[Swap]]:
    """agent -> slot, from every agent in the slot of its own number; and which swaps were skipped."""
    slot_of, skipped, order = list(range(n)), set(), sorted(ops)
    for place, op in enumerate(order):
        later = [other for other in order[place + 1 :] if not other.taken]
        found = [
            next((_slot(other, who) for other in later if who in (other.agent_a, other.agent_b)), None)
            for who in (op.agent_a, op.agent_b)
        ]
        unknown = op.taken and (found[0] == op.slot_a or found[1] == op.slot_b)
        if not unknown and slot_of[op.agent_a] == op.slot_a and slot_of[op.agent_b] == op.slot_b:
            slot_of[op.agent_a], slot_of[op.agent_b] = op.slot_b, op.slot_a
        else:
            skipped.add(op)
    return tuple(slot_of), frozenset(skipped)


def _slot(op: Swap, agent: int) -> int:
    return op.slot_a if agent == op.agent_a else op.slot_b
