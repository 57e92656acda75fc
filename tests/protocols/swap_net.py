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
from protocols.slots.history import Checkpoint, Swap

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
    """N parties, the air between them, and a clock that the test advances."""

    def __init__(self, n: int, rules: SwapRules = QUICK) -> None:
        self.n, self.rules, self.tick = n, rules, 0
        self.endpoints = [SlotParty(agent, range(n), rules) for agent in range(n)]
        self.boots = [0] * n
        self.alive = set(range(n))
        self.links = {(a, b) for a in range(n) for b in range(n) if a != b}
        self.air: list[Packet] = []
        self.oracle = Oracle(self)

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
            self.oracle.look(note)

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
    """Knows which swaps each party has learned, and holds every party to it after every step.

    The view is a permutation, and is what an independent fold of exactly the known swaps gives.
    The digest is the sum over exactly those swaps, whatever has been folded; so is a checkpoint's.
    A swap was agreed to by both, unless it took a dead agent's slot. No nonce was used twice.
    What is in a checkpoint has been known to every agent, unless somebody folded by force.
    A swap acted on is undone only by an earlier swap just learned, or by a checkpoint that was adopted.
    """

    def __init__(self, swarm: Swarm) -> None:
        self._swarm = swarm
        self.ever: set[Swap] = set()
        self.known: list[frozenset[Swap]] = [frozenset()] * swarm.n
        self._knew: list[frozenset[Swap]] = [frozenset()] * swarm.n  # what was forgotten included
        self._forced = False
        self._start = swarm.endpoints[0].book.base
        self._swaps_in = {self._start: frozenset[Swap]()}
        self._base = [self._start] * swarm.n
        self._seen: list[object] = [None] * swarm.n
        self._agreed: set[tuple[int, int, int]] = set()

    def forget(self, agent: int) -> None:
        """The agent restarted."""
        self.known[agent], self._base[agent], self._seen[agent] = frozenset(), self._start, None

    def look(self, heard: SlotNote | None = None) -> None:
        """Check everybody, after a step in which one party heard this note."""
        for agent, party in enumerate(self._swarm.endpoints):
            deal = party.deal
            if deal is not None and party.stance is Stance.PROMISED:
                self._agreed.add((deal.proposer, deal.nonce, agent))
            signature = (party.book.base, party.digest, party.counts.undone, party.counts.adopted)
            if signature != self._seen[agent]:
                self._check(agent, party, heard)
                self._seen[agent] = signature

    def _check(self, agent: int, party: SlotParty, heard: SlotNote | None) -> None:
        book, before = party.book, self.known[agent]
        if book.base not in self._swaps_in:
            self._swaps_in[book.base] = self._trace(agent, book.base, heard)
        now = self._swaps_in[book.base] | set(book.open)
        self.known[agent], self._base[agent] = now, book.base
        self._knew[agent] |= now
        self._forced |= any(other.counts.forced for other in self._swarm.endpoints)
        if not self._forced:
            assert all(self._swaps_in[book.base] <= knew for knew in self._knew), "folded too early"
        assert sorted(party.slot_of) == list(range(self._swarm.n)), "not a permutation"
        assert party.slot_of == fold(now, self._swarm.n), "the view is not the fold of the swaps"
        assert party.digest == self._digest(now), "the digest is not that of the swaps"
        for op in now - self.ever:
            took_dead = op.agent_b not in self._swarm.alive
            assert took_dead or (op.initiator, op.nonce, op.agent_b) in self._agreed, f"never agreed: {op}"
            assert all(old[1:3] != op[1:3] for old in self.ever), "a nonce was used twice"
            self.ever.add(op)
        _, _, undone, adopted = self._seen[agent] or (None, None, 0, 0)
        if party.counts.undone > undone and party.counts.adopted == adopted:
            acted = [op for op in before if op.involves(agent)]
            assert any(new < op for op in acted for new in now - before), "undone without an earlier swap"

    def _trace(self, agent: int, base: Checkpoint, heard: SlotNote | None) -> frozenset[Swap]:
        """The swaps in a new checkpoint, folded on from its owner's last one or from one just heard."""
        candidates = self.known[agent].union(heard.ops if heard else ())
        froms = [self._base[agent], *([heard.checkpoint] if heard and heard.checkpoint else [])]
        for start in froms:
            added = (op for op in candidates if start.clock < op.counter <= base.clock)
            swaps = self._swaps_in[start].union(added)
            if self._digest(swaps) == base.digest:
                assert base.slot_of == fold(swaps, self._swarm.n), "a checkpoint that is no fold of its swaps"
                return swaps
        raise AssertionError("a checkpoint of unknown swaps")

    def _digest(self, ops: Iterable[Swap]) -> int:
        hashes = (int.from_bytes(blake2b(pack("<7q", *op), digest_size=8).digest(), "little") for op in ops)
        return (self._start.digest + sum(hashes)) % 2**64


def fold(ops: Iterable[Swap], n: int) -> tuple[int, ...]:
    """agent -> slot, from every agent in the slot of its own number."""
    slot_of = list(range(n))
    for op in sorted(ops):
        if slot_of[op.agent_a] == op.slot_a and slot_of[op.agent_b] == op.slot_b:
            slot_of[op.agent_a], slot_of[op.agent_b] = op.slot_b, op.slot_a
    return tuple(slot_of)
