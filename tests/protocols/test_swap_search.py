"""Every interleaving, to a stated depth, of a few agents that swap.

The alphabet; one event is one step:

    propose a b     any two, in either direction, up to `proposals` in all
    frame a to S    a broadcasts; of the others exactly those in S hear it, S not empty. (A frame that nobody
                    hears is no event: what it said is said again by the next)
    delay a to b    b will hear this very frame of a's, but later; `late` frames at most are under way
    arrive          a delayed frame is heard; one that never arrives was lost
    double          a delayed frame is heard, and will be heard again
    time-out a      a has waited too long for what it is engaged in
    crash a         a falls silent for good, up to `crashes`; then anyone in a larger slot may take its slot
    restart a       a starts anew with amnesia, up to `restarts`, while another remembers
    lie to S        the last agent lies to one or to all, up to `lies`: takes the slot of one who lives, now, in the past or
                    in the future; makes up a swap of two others; says that all have had everything, or that it knows
                    nothing; and, if it `deals`, asks for a swap with whatever clock, refuses what it was not asked, and uses
                    a consent that it was given, when it likes. If it deals it is in all else an agent as the others

Time-outs strike at any moment and nobody cools down, so whatever clocks could do is among the schedules.
Equal states are visited once. In every state visited:

    the view is a permutation, and equal digests mean equal views;
    without time-outs, crashes and restarts, no swap that a party acted on is ever undone; with a liar that does not deal,
    none that two honest agents agreed to;
    if from here on all deals time out and every frame is heard, then within ROUNDS rounds of one broadcast
    each all living are idle and agree, without the liar: no schedule leads to a permanent lock or a permanent difference.

RSC_SWARM_DEEP=1 searches deeper. One alone: `python tests/protocols/test_swap_search.py "Alphabet(3, 10, 2)"`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import pytest

from protocols.slots.agreement import SlotNote, SlotParty, Stance, SwapRules
from protocols.slots.history import MAX_LEAP, Swap, pack_swap
from protocols.slots.notes import Proposal, Refusal
from protocols.slots.seals import Sealed, Stamps

DEEP = os.environ.get("RSC_SWARM_DEEP") == "1"
RULES = SwapRules(
    cooldown_ticks=0, answer_ticks=1, lock_ticks=1, retry_ticks=0, repair_frames=1, ack_frames=0
)
ROUNDS = 4


@dataclass(frozen=True)
class Alphabet:
    """Which events there are, and how many; `depth` is the number of events in the longest schedule."""

    agents: int
    depth: int
    proposals: int
    late: int = 0
    time_outs: bool = False
    crashes: int = 0
    restarts: int = 0
    lies: int = 0
    deals: bool = False
    """Whether the liar agrees to swaps with others."""
    ring: bool = False
    """True: a proposes only to a + 1, the last to the first, and a frame is heard by one or by all."""

    @property
    def calm(self) -> bool:
        return not (self.time_outs or self.crashes or self.restarts or self.deals)

    @property
    def liar(self) -> int | None:
        return self.agents - 1 if self.lies else None


class Seat(NamedTuple):
    """One agent's party. Its clock moves only at its own time-outs. A party in a seat is never changed."""

    party: SlotParty
    tick: int
    mind: int
    alive: bool = True

    def after(self, act: str, *arguments: object) -> Seat:
        party = copy(self.party)
        getattr(party, act)(*arguments, self.tick)
        return self._replace(party=party, mind=hash(party.state_key(self.tick)))


class State(NamedTuple):
    seats: tuple[Seat, ...]
    late: tuple[tuple[int, int, SlotNote], ...] = ()
    proposals: int = 0
    crashes: int = 0
    restarts: int = 0
    lies: int = 0
    consents: tuple[tuple[Swap, bytes], ...] = ()  # to swaps with the liar

    def key(self) -> int:
        """What is the same for equal states: 64 bits, so a search of ten million states overlooks one with a
        chance of 1 in 400,000."""
        return hash((tuple((seat.mind, seat.alive) for seat in self.seats), *self[1:]))

    def seat(self, agent: int, seat: Seat) -> State:
        return self._replace(seats=(*self.seats[:agent], seat, *self.seats[agent + 1 :]))

    @property
    def living(self) -> list[int]:
        return [agent for agent, seat in enumerate(self.seats) if seat.alive]


def successors(state: State, alphabet: Alphabet) -> Iterator[State]:
    for agent in state.living:
        if agent == alphabet.liar and not alphabet.deals:
            continue  # nobody hears of its swaps
        seat = state.seats[agent]
        yield from _deals(state, alphabet, agent, seat)
        yield from _frames(state, alphabet, agent, seat)
        if alphabet.time_outs and seat.party.deal is not None:
            yield state.seat(agent, _timed_out(seat))
        if state.crashes < alphabet.crashes:
            yield state.seat(agent, seat._replace(alive=False))._replace(crashes=state.crashes + 1)
    if state.restarts < alphabet.restarts:
        for agent in range(alphabet.agents):
            if any(state.seats[o].party.stance is not Stance.AMNESIAC for o in state.living if o != agent):
                number = state.restarts + 1
                party = SlotParty(agent, range(alphabet.agents), RULES, nonce=number, amnesiac=True)
                yield state.seat(agent, Seat(party, 0, hash(party.state_key())))._replace(restarts=number)
    if state.lies < alphabet.lies:
        yield from _lies(state, alphabet)
    for i, (speaker, listener, note) in enumerate(state.late):
        if state.seats[listener].alive:
            heard = _heard(state, speaker, (listener,), note)
            yield heard
            yield heard._replace(late=state.late[:i] + state.late[i + 1 :])


def _lies(state: State, alphabet: Alphabet) -> Iterator[State]:
    liar = alphabet.agents - 1
    honest = [agent for agent in state.living if agent != liar]
    for note in lies(state, alphabet):
        told = state._replace(lies=state.lies + 1)
        for listeners in {(honest[0],), (honest[-1],), tuple(honest)}:
            yield _heard(told, liar, listeners, note)


def _with_consents(state: State, liar: int) -> State:
    for seat in state.seats:
        deal = seat.party.deal
        if deal is not None and seat.party.stance is Stance.PROMISED and deal.proposer == liar:
            consent = (deal.swap(deal.counter), deal.seal)
            if consent not in state.consents:
                state = state._replace(consents=(*state.consents, consent))
    return state


def lies(state: State, alphabet: Alphabet) -> Iterator[SlotNote]:
    """What the liar could say now that is not so."""
    liar = alphabet.agents - 1
    seals = Stamps(liar)
    nonce = 100 + state.lies
    for victim in range(liar):
        party = state.seats[victim].party
        slots, clock = party.slot_of, party.book.clock
        for counter in (1, clock + 1, clock + MAX_LEAP):
            op = Swap(counter, liar, nonce, slots[liar], victim, slots[victim], taken=True)
            yield SlotNote(0, False, ops=(Sealed(op, seals.seal(pack_swap(op))),))
        yield SlotNote(party.digest, settled=True)
        if alphabet.deals:
            for asked in (0, clock + MAX_LEAP):
                ask = Proposal(victim, nonce, slots[liar], slots[victim], asked)
                yield SlotNote(0, False, proposal=ask)
    slots = state.seats[0].party.slot_of
    op = Swap(1, 0, nonce, slots[0], 1, slots[1])
    yield SlotNote(0, False, ops=(Sealed(op, 2 * seals.seal(pack_swap(op))),))
    yield SlotNote(0, True, amnesiac=True)
    for op, seal in state.consents:
        yield SlotNote(0, False, ops=(Sealed(op, seals.seal(pack_swap(op)) + seal),))
    if alphabet.deals:
        deals = [seat.party.deal for seat in state.seats[:liar] if seat.party.deal is not None]
        yield SlotNote(0, True, refusals=tuple(Refusal(deal.proposer, deal.nonce) for deal in deals))


def _deals(state: State, alphabet: Alphabet, agent: int, seat: Seat) -> Iterator[State]:
    if state.proposals < alphabet.proposals and seat.party.ready(seat.tick):
        ahead = (agent + 1) % alphabet.agents
        for partner in range(alphabet.agents):
            if partner == ahead or (partner != agent and not alphabet.ring):
                proposing = seat.after("propose", partner)
                yield state.seat(agent, proposing)._replace(proposals=state.proposals + 1)
    for dead, other in enumerate(state.seats):
        if not other.alive and seat.party.may_vacate(dead) and seat.party.slot_of[dead] < seat.party.slot:
            yield state.seat(agent, seat.after("vacate", dead))


def _frames(state: State, alphabet: Alphabet, agent: int, seat: Seat) -> Iterator[State]:
    others = [other for other in state.living if other != agent]
    note, spoken = _spoken(state, agent)
    sizes = {1, len(others)} - {0} if alphabet.ring else range(1, len(others) + 1)
    for size in sizes:
        for listeners in combinations(others, size):
            yield _heard(spoken, agent, listeners, note)
    if len(state.late) < alphabet.late and not note.quiet:
        for other in others:
            yield spoken._replace(late=(*state.late, (agent, other, note)))


def _spoken(state: State, agent: int) -> tuple[SlotNote, State]:
    seat = state.seats[agent]
    party = copy(seat.party)
    note = party.note(seat.tick)
    if note.quiet and seat.party.quiet:
        return note, state
    return note, state.seat(agent, seat._replace(party=party, mind=hash(party.state_key(seat.tick))))


def _heard(state: State, speaker: int, listeners: tuple[int, ...], note: SlotNote) -> State:
    for listener in listeners:
        seat = state.seats[listener]
        if not (note.quiet and seat.party.quiet and note.digest == seat.party.digest):
            state = state.seat(listener, seat.after("hear", note, speaker))
    return state


def _timed_out(seat: Seat) -> Seat:
    seat = seat._replace(tick=seat.tick + 1).after("advance")
    assert seat.party.deal is None, "a deal outlived its time-out"
    return seat


class Healing:
    """How many rounds a state needs, if from there on nothing fails, until all living are idle and agree."""

    def __init__(self, liar: int | None) -> None:
        self._liar = liar
        self._rounds: dict[int, int] = {}

    def rounds(self, state: State) -> int:
        state = state._replace(late=(), proposals=0, crashes=0, restarts=0)
        if self._liar is not None:
            liar = state.seats[self._liar]._replace(alive=False)
            state = state.seat(self._liar, liar)._replace(lies=0, consents=())
        for agent in state.living:
            if state.seats[agent].party.deal is not None:
                state = state.seat(agent, _timed_out(state.seats[agent]))
        return self._count(state, ROUNDS)

    def _count(self, state: State, left: int) -> int:
        parties = [state.seats[agent].party for agent in state.living]
        agreed = len({(party.digest, party.slot_of) for party in parties}) == 1
        if agreed and all(party.stance is Stance.IDLE for party in parties):
            return 0
        key = state.key()
        if key not in self._rounds:
            assert left > 0, "no agreement"
            for agent in state.living:
                note, state = _spoken(state, agent)
                state = _heard(state, agent, tuple(other for other in state.living if other != agent), note)
            self._rounds[key] = 1 + self._count(state, left - 1)
        return self._rounds[key]


class Found(NamedTuple):
    states: int
    """Distinct states visited."""
    undone: int
    """States in which a party has seen a swap undone that it acted on."""
    rounds: int
    """The most rounds any state needed to heal."""


def _regrets(party: SlotParty, liar: int | None) -> bool:
    """Whether a swap that it agreed to with an honest agent is turned off; without a liar, whether anything ever was."""
    if liar is None:
        return party.counts.undone > 0
    mine = (op for op in party.book.swaps_of(party.me) if liar not in (op.agent_a, op.agent_b))
    return any(op in party.book.skipped and not op.taken for op in mine)


def search(alphabet: Alphabet) -> Found:
    n = alphabet.agents
    parties = [SlotParty(agent, range(n), RULES) for agent in range(n)]
    start = State(tuple(Seat(party, 0, hash(party.state_key())) for party in parties))
    seen, views, healing, honest = {start.key()}, {}, Healing(alphabet.liar), slice(alphabet.liar)
    frontier, undone, rounds = [start], 0, 0
    for _ in range(alphabet.depth):
        following = []
        for state in frontier:
            for after in successors(state, alphabet):
                regret = any(_regrets(seat.party, alphabet.liar) for seat in after.seats[honest])
                assert not (regret and alphabet.calm), "undone though nothing failed"
                if alphabet.liar is not None:
                    after = _with_consents(after, alphabet.liar)
                key = after.key()
                if key in seen:
                    continue
                seen.add(key)
                following.append(after)
                rounds = max(rounds, healing.rounds(after))
                undone += regret
                for seat in after.seats[honest]:
                    slots = views.setdefault(seat.party.digest, seat.party.slot_of)
                    assert slots == seat.party.slot_of, "equal digests, unequal views"
        frontier = following
    assert all(sorted(view) == list(range(n)) for view in views.values()), "not a permutation"
    return Found(len(seen), undone, rounds)


EVERY_TEST = [
    Alphabet(3, depth=10, proposals=2),
    Alphabet(3, depth=10, proposals=2, time_outs=True),
    Alphabet(3, depth=6, proposals=2, time_outs=True, late=1),
    Alphabet(3, depth=7, proposals=2, crashes=1),
    Alphabet(3, depth=6, proposals=1, restarts=1),
    Alphabet(4, depth=7, proposals=2, ring=True),
    Alphabet(3, depth=4, proposals=1, lies=2),
    Alphabet(3, depth=4, proposals=1, lies=1, deals=True, time_outs=True),
]
DEEP_TEST = [
    Alphabet(3, depth=14, proposals=3),
    Alphabet(3, depth=11, proposals=3, time_outs=True),
    Alphabet(3, depth=10, proposals=2, time_outs=True, late=1),
    Alphabet(3, depth=10, proposals=2, crashes=1, time_outs=True),
    Alphabet(3, depth=9, proposals=2, restarts=1, time_outs=True),
    Alphabet(4, depth=9, proposals=2),
    Alphabet(4, depth=9, proposals=2, ring=True, time_outs=True),
    Alphabet(3, depth=6, proposals=2, lies=2),
    Alphabet(3, depth=5, proposals=1, lies=2, deals=True, time_outs=True),
]


@pytest.mark.timeout(3600 if DEEP else 300)
@pytest.mark.parametrize("alphabet", DEEP_TEST if DEEP else EVERY_TEST, ids=str)
def test_no_schedule_breaks_the_protocol(alphabet: Alphabet) -> None:
    found = search(alphabet)
    print(f"{alphabet}: {found}")
    assert found.states > 1000, "the search has become vacuous"


if __name__ == "__main__":
    import sys
    import time

    began = time.perf_counter()
    print(sys.argv[1], search(eval(sys.argv[1])), f"{time.perf_counter() - began:.1f} s")
