"""Seals: what a liar with a login of its own cannot make others believe."""

from __future__ import annotations

import msgpack
import pytest

from agent.slot_endpoints import swaps_per_note
from protocols.slots.agreement import SlotNote, SlotParty, Stance, SwapRules, encode
from protocols.slots.history import MAX_LEAP, Swap, pack_swap
from protocols.slots.notes import Acceptance, Proposal, Refusal, decode
from protocols.slots.seals import SEAL_BYTES, Sealed, Stamps
from protocols.slots.signatures import KEY_BYTES, Signatures, public_key
from protocols.wire.frames import (
    MAX_FRAME_BYTES,
    MAX_KNOWN,
    RELAYING,
    VERSION,
    FrameWriter,
    empty_frames,
)

PRIVATE = [bytes([agent]) * KEY_BYTES for agent in range(3)]
PUBLIC = [public_key(key) for key in PRIVATE]
OP = Swap(1, 0, 1, 0, 1, 1)


def signatures(agent: int, flight: bytes = b"one") -> Signatures:
    return Signatures(PRIVATE[agent], PUBLIC, flight)


def sealed(op: Swap, *agents: int, flight: bytes = b"one") -> Sealed:
    return Sealed(op, b"".join(signatures(agent, flight).seal(pack_swap(op)) for agent in agents))


def test_a_swap_needs_the_seals_of_both_and_a_taking_that_of_the_taker() -> None:
    assert sealed(OP, 0, 1).holds(signatures(2))
    taking = OP._replace(taken=True)
    assert sealed(taking, 0).holds(signatures(2))
    lacking = [
        sealed(OP, 0),
        sealed(OP, 0, 0),
        sealed(OP, 1, 0),
        sealed(OP, 0, 2),
        Sealed(OP, bytes(2 * SEAL_BYTES)),
        sealed(taking, 1),
        sealed(taking, 0, 1),
        Sealed(taking, sealed(OP, 0).seals),
        Sealed(OP, b""),
    ]
    assert not any(swap.holds(signatures(2)) for swap in lacking)


@pytest.mark.parametrize("field", Swap._fields)
def test_a_seal_is_good_for_one_swap_only(field: str) -> None:
    seals = sealed(OP, 0, 1).seals
    altered = OP._replace(**{field: 2 if field != "taken" else True})
    assert not Sealed(altered, seals).holds(signatures(2))


def test_a_seal_is_good_in_one_flight_only() -> None:
    assert not sealed(OP, 0, 1, flight=b"another").holds(signatures(2))


def test_two_agree_under_real_signatures_and_a_third_believes_it() -> None:
    a, b, c = (SlotParty(agent, range(3), SwapRules(), seals=signatures(agent)) for agent in range(3))
    a.propose(1, tick=0)
    for speaker, listeners in ((a, (b,)), (b, (a,)), (a, (b, c))):
        note = decode(msgpack.unpackb(msgpack.packb(encode(speaker.note(0)))), 3)
        for listener in listeners:
            listener.hear(note, speaker.me, 0)
    assert {party.slot_of for party in (a, b, c)} == {(1, 0, 2)}
    assert not any(party.counts.unsealed for party in (a, b, c))


# What was tried on the product, and its kin. Agent 2 lies.


def forged(**fields: object) -> SlotNote:
    return SlotNote(digest=5, settled=False)._replace(**fields)  # type: ignore[arg-type]


def taking(counter: int) -> Sealed:
    op = Swap(counter, 2, 1, 2, 1, 1, taken=True)
    return Sealed(op, Stamps(2).seal(pack_swap(op)))


def of_others(counter: int) -> Sealed:
    op = Swap(counter, 0, 1, 0, 1, 1)
    return Sealed(op, 2 * Stamps(2).seal(pack_swap(op)))


LAST = 2**56 - 1
ATTACKS = {
    "a swap of two others": forged(ops=(of_others(1),)),
    "one that counts as much as can be": forged(ops=(of_others(LAST),)),
    "a slot taken at the end of counting": forged(ops=(taking(LAST),)),
    "a slot taken just too far ahead": forged(ops=(taking(MAX_LEAP + 2),)),
    "a proposal from the end of counting": forged(proposal=Proposal(0, 9, 2, 0, LAST)),
    "a proposal of slots that are others'": forged(proposal=Proposal(0, 9, 1, 0, 0)),
    "a history that everybody has had": forged(had=7, settled=True),
    "an amnesia": forged(amnesiac=True),
    "an acceptance of what was not asked of it": forged(acceptance=Acceptance(0, 1, 1, bytes(SEAL_BYTES))),
    "a refusal of what was not asked of it": forged(refusals=(Refusal(0, 1), Refusal(1, 1))),
}


@pytest.mark.parametrize("attack", ATTACKS)
def test_a_lie_moves_nobody_and_the_others_go_on_agreeing(attack: str) -> None:
    a, b, _ = swarm = [SlotParty(agent, range(3), SwapRules()) for agent in range(3)]
    a.propose(1, tick=0)
    for _ in range(3):
        for speaker in swarm[:2]:
            for listener in swarm[:2]:
                listener.hear(ATTACKS[attack], 2, 0)
            note = decode(msgpack.unpackb(msgpack.packb(encode(speaker.note(0)))), 3)
            for listener in swarm[:2]:
                listener.hear(note, speaker.me, 0)
    assert (a.slot_of, b.slot_of) == ((1, 0, 2), (1, 0, 2))
    assert a.book.clock == b.book.clock == 1


def test_who_accepts_cannot_leap_ahead_nor_seal_something_else() -> None:
    for counter, sealed_counter in ((LAST, LAST), (MAX_LEAP + 1, MAX_LEAP + 1), (0, 0), (1, 2)):
        a = SlotParty(0, range(3), SwapRules())
        a.propose(2, tick=0)
        assert a.deal is not None
        seal = Stamps(2).seal(pack_swap(a.deal.swap(sealed_counter)))
        a.hear(forged(acceptance=Acceptance(0, a.deal.nonce, counter, seal)), 2, 0)
        assert a.slot == 0
        assert (a.stance, a.counts.unsealed) == (Stance.PROPOSING, 1)


def test_who_asks_again_and_again_binds_its_partner_for_two_promises_at_most() -> None:
    rules = SwapRules(lock_ticks=20, cooldown_ticks=30)
    a = SlotParty(0, range(3), rules)
    bound = []
    for tick in range(200):
        a.hear(forged(proposal=Proposal(0, tick, 2, 0, 0)), 2, tick)
        bound.append(a.stance is Stance.PROMISED)
    assert "".join("x" if yes else "." for yes in bound).split("." * 29)[0].count("x") <= 2 * rules.lock_ticks
    assert sum(bound) < 0.6 * len(bound)


def test_a_false_word_on_who_has_had_a_swap_keeps_it_from_nobody_who_shows_that_it_lacks_it() -> None:
    a, b, _ = (SlotParty(agent, range(3), SwapRules()) for agent in range(3))
    a.vacate(1, tick=0)
    a.hear(SlotNote(a.digest, settled=False, had=7), 2, 0)
    assert a.book.settled == 1
    for tick in range(1, 100):
        a.note(tick)  # all is quiet
    a.hear(b.note(100), 1, 100)
    b.hear(a.note(100), 0, 100)
    assert b.slot_of == a.slot_of


@pytest.mark.parametrize("agents", [2, 4, 25, 36, 64, 65, 100, 250])
@pytest.mark.parametrize("relays", [False, True])
def test_the_largest_note_fits_into_a_frame(agents: int, relays: bool) -> None:
    frames = empty_frames(1)
    frames.version[0] = RELAYING if relays else VERSION
    frames.fixed["known_count"] = min(agents - 1, MAX_KNOWN)
    swap = Sealed(Swap(LAST, agents - 1, LAST, agents - 1, 0, agents - 2), bytes(2 * SEAL_BYTES))
    note = SlotNote(
        digest=2**64 - 1,
        settled=False,
        amnesiac=True,
        acceptance=Acceptance(agents - 1, LAST, LAST, bytes(SEAL_BYTES)),
        refusals=(Refusal(agents - 1, LAST),) * 8,
        ops=(swap,) * swaps_per_note(agents, relays),
        had=(1 << agents) - 1,
    )
    assert swaps_per_note(agents, relays) >= 3
    assert len(FrameWriter(frames).write(0, msgpack.packb(encode(note)))) <= MAX_FRAME_BYTES
