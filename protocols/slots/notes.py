"""What agents say to each other about slots: one note in every broadcast frame.

The rules
    1. A quiet note is the digest and whether all its swaps are in the sender's checkpoint: 11 bytes.
    2. Any other note is a list of nine fields in the order of `SlotNote`; an absent one is None or empty.
    3. A note from the air is believed only if every number in it is a whole number in its range, every list
       is within its limit, every seal is as long as one, and every swap and assignment could exist among the
       mission's agents. Otherwise `decode` raises ValueError. Whether the seals hold is for the party to find out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from reprlib import repr as shown  # of what strangers send, however long or deep
from typing import Any, NamedTuple, TypeVar

from protocols.slots.history import Swap, is_permutation
from protocols.slots.seals import SEAL_BYTES, Sealed
from protocols.slots.written import pack_slots, unpack_slots

MAX_OPS = 16
"""Swaps in one note, at most."""
MAX_REFUSALS = 8
"""Refusals in one note, at most; whoever gets none asks again in its next frame."""

_COUNTER_END = 1 << 56
_NONCE_END = 1 << 56
_DIGEST_END = 1 << 64

T = TypeVar("T")


class Proposal(NamedTuple):
    """The sender, in `slot`, asks `partner`, in `partner_slot`, to change places. No nonce is used twice. The swap must count
    more than `clock`, all that the sender knew when it asked."""

    partner: int
    nonce: int
    slot: int
    partner_slot: int
    clock: int


class Refusal(NamedTuple):
    """Names a proposal that will not be committed."""

    proposer: int
    nonce: int


class Acceptance(NamedTuple):
    """The sender is promised to that proposal, as a swap of this `counter`, on which it has put its `seal`."""

    proposer: int
    nonce: int
    counter: int
    seal: bytes


class Assignment(NamedTuple):
    """Who is in which slot, all of it, after so many changes, the last by `initiator`: protocols.slots.highest_version only."""

    slot_of: tuple[int, ...]
    version: int
    initiator: int


class SlotNote(NamedTuple):
    """What one frame says about slots.

    `settled`: as far as the sender knows everybody has had all swaps of `digest`. `amnesiac`: the sender restarted,
    knows nothing and asks for the history. `refusals` are said by the one asked, or by the proposer itself to
    release the one promised. `had`: bit k says that agent k has had exactly the swaps of `digest`.
    """

    digest: int
    settled: bool
    amnesiac: bool = False
    proposal: Proposal | None = None
    acceptance: Acceptance | None = None
    refusals: tuple[Refusal, ...] = ()
    ops: tuple[Sealed, ...] = ()
    had: int = 0
    whole: Assignment | None = None

    @property
    def quiet(self) -> bool:
        """True if the note says nothing but its digest."""
        return self[2:] == QUIET


QUIET: tuple[object, ...] = SlotNote(0, settled=True)[2:]
"""The last seven fields of a quiet note."""


def encode(note: SlotNote) -> tuple[Any, ...]:
    """The note as msgpack can write it."""
    if note[2:] == QUIET:
        return (note.digest, int(note.settled))
    whole = note.whole
    packed = None if whole is None else (pack_slots(whole.slot_of), *whole[1:])
    ops = [
        (*op[:-1], seals) for op, seals in note.ops
    ]  # the number of its seals says whether the slot was taken
    had = note.had.to_bytes((note.had.bit_length() + 7) // 8, "little")
    return (note.digest, int(note.settled), int(note.amnesiac), *note[3:6], ops, had, packed)


def decode(obj: object, n_agents: int) -> SlotNote:
    """The note that `encode` wrote, as msgpack read it. ValueError for what `encode` would not write."""
    fields = _list(obj)
    if len(fields) not in (2, 9):
        raise ValueError(f"a note has 2 or 9 fields, not {len(fields)}")
    digest, settled = _int(fields[0], _DIGEST_END), bool(_int(fields[1], 2))
    if len(fields) == 2:
        return SlotNote(digest, settled)
    amnesiac, proposal, acceptance, refusals, ops, had, whole = fields[2:]

    def read_proposal(item: object) -> Proposal:
        read = Proposal(*_ints(item, (n_agents, _NONCE_END, n_agents, n_agents, _COUNTER_END)))
        if read.slot == read.partner_slot:
            raise ValueError(f"a proposal to change a slot with itself: {read}")
        return read

    def read_refusal(item: object) -> Refusal:
        return Refusal(*_ints(item, (n_agents, _NONCE_END)))

    def read_acceptance(item: object) -> Acceptance:
        *numbers, seal = _list(item)
        proposer, nonce, counter = _ints(numbers, (n_agents, _NONCE_END, _COUNTER_END))
        return Acceptance(proposer, nonce, counter, _seals(seal, (1,)))

    def read_swap(item: object) -> Sealed:
        *numbers, seals = _list(item)
        sealed = _seals(seals, (1, 2))
        counter, *who = _ints(numbers, (_COUNTER_END, n_agents, _NONCE_END, n_agents, n_agents, n_agents))
        op = Swap._make([counter, *who, len(sealed) == SEAL_BYTES])
        if op.counter < 1 or op.slot_a == op.slot_b or op.agent_a == op.agent_b:
            raise ValueError(f"not a swap: {op}")
        return Sealed(op, sealed)

    def read_whole(item: object) -> Assignment:
        packed, *rest = _list(item)
        slot_of = unpack_slots(packed, n_agents)
        if not is_permutation(slot_of):
            raise ValueError("an assignment is a permutation of all slots")
        return Assignment(tuple(slot_of.tolist()), *_ints(rest, (_COUNTER_END, n_agents)))

    return SlotNote(
        digest,
        settled,
        bool(_int(amnesiac, 2)),
        _maybe(proposal, read_proposal),
        _maybe(acceptance, read_acceptance),
        _several(refusals, MAX_REFUSALS, read_refusal),
        _several(ops, MAX_OPS, read_swap),
        _agents(had, n_agents),
        _maybe(whole, read_whole),
    )


def _int(value: object, end: int) -> int:
    if type(value) is int and 0 <= value < end:  # a bool is no number here
        return value
    raise ValueError(f"not a whole number from 0 to {end - 1}: {shown(value)}")


def _agents(value: object, n_agents: int) -> int:
    if type(value) is bytes and len(value) <= (n_agents + 7) // 8:
        return _int(int.from_bytes(value, "little"), 1 << n_agents)
    raise ValueError(f"not a set of {n_agents} agents: {shown(value)}")


def _seals(value: object, numbers: tuple[int, ...]) -> bytes:
    if type(value) is bytes and len(value) in [number * SEAL_BYTES for number in numbers]:
        return value
    raise ValueError(f"not seals: {shown(value)}")


def _list(value: object) -> Sequence[object]:
    if isinstance(value, list | tuple):
        return value
    raise ValueError(f"not a list: {shown(value)}")


def _ints(value: object, ends: Sequence[int]) -> list[int]:
    items = _list(value)
    if len(items) != len(ends):
        raise ValueError(f"{len(ends)} numbers expected: {shown(value)}")
    return [_int(item, end) for item, end in zip(items, ends, strict=True)]


def _maybe(value: object, read: Callable[[object], T]) -> T | None:
    return None if value is None else read(value)


def _several(value: object, limit: int, read: Callable[[object], T]) -> tuple[T, ...]:
    items = _list(value)
    if len(items) > limit:
        raise ValueError(f"{len(items)} items where {limit} may be")
    return tuple(read(item) for item in items)
