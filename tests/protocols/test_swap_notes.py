"""Slot notes from the air: what is believed, and what is an error."""

from __future__ import annotations

from typing import Any

import msgpack
import pytest

from protocols.slots.history import Swap
from protocols.slots.notes import Acceptance, Assignment, Proposal, Refusal, SlotNote, decode, encode
from protocols.slots.seals import SEAL_BYTES, Sealed

FULL = SlotNote(
    digest=2**64 - 1,
    settled=False,
    amnesiac=True,
    proposal=Proposal(1, 7, 0, 1, 3),
    acceptance=Acceptance(2, 9, 4, bytes(SEAL_BYTES)),
    refusals=(Refusal(1, 3),),
    ops=(
        Sealed(Swap(3, 0, 1, 0, 1, 1), bytes(2 * SEAL_BYTES)),
        Sealed(Swap(4, 2, 1, 0, 1, 1, True), bytes(SEAL_BYTES)),
    ),
    had=0b101,
    whole=Assignment((2, 0, 1), version=6, initiator=1),
)


@pytest.mark.parametrize("note", [FULL, SlotNote(5, True), SlotNote(5, False)])
def test_notes_survive_the_air(note: SlotNote) -> None:
    assert decode(msgpack.unpackb(msgpack.packb(encode(note))), 3) == note


ONE, BOTH = bytes(SEAL_BYTES), bytes(2 * SEAL_BYTES)
WRONG: list[tuple[int, Any]] = [
    (0, -1),
    (0, 2**64),
    (0, 1.0),
    (0, True),
    (1, 2),
    (1, None),
    (2, 2),
    (3, [1, 7, 0, 1]),
    (3, [3, 7, 0, 1, 3]),
    (3, [1, 7, 1, 1, 3]),
    (3, [1, 7, 0, 1, 2**56]),
    (3, "abcde"),
    (3, [1, True, 0, 1, 3]),
    (4, [3, 9, 4, ONE]),
    (4, [2, 9, 4]),
    (4, [2, 9, 4, ONE[1:]]),
    (4, [2, 9, 4, BOTH]),
    (4, [2, 9, 4, None]),
    (4, []),
    (5, None),
    (5, [[1, 3]] * 9),
    (6, [[0, 0, 1, 0, 1, 1, BOTH]]),
    (6, [[3, 0, 1, 0, 0, 1, BOTH]]),
    (6, [[3, 0, 1, 0, 3, 1, BOTH]]),
    (6, [[3, 0, 1, 1, 1, 1, BOTH]]),
    (6, [[3, 0, 1, 0, 1, 1, BOTH]] * 17),
    (6, [[2**56, 0, 1, 0, 1, 1, BOTH]]),
    (6, [[3, 0, 1, 0, 1, 1]]),
    (6, [[3, 0, 1, 0, 1, 1, b""]]),
    (6, [[3, 0, 1, 0, 1, 1, BOTH + ONE]]),
    (6, [[]]),
    (7, 5),
    (7, b"\x08"),
    (7, b"\1\0"),
    (8, []),
    (8, [b"\0\0\1", 6, 1]),
    (8, [b"\0\1", 6, 1]),
    (8, [[0, 1, 2], 6, 1]),
    (8, [b"\0\1\2", 6]),
]


@pytest.mark.parametrize(("field", "value"), WRONG)
def test_a_malformed_field_is_an_error(field: int, value: object) -> None:
    fields = list(encode(FULL))
    fields[field] = value
    with pytest.raises(ValueError, match=r"."):
        decode(fields, 3)


@pytest.mark.parametrize("wrong", [None, 5, b"ab", "ab", {}, [], [1], [1, 1, 1], [[], []]])
def test_a_malformed_note_is_an_error(wrong: object) -> None:
    with pytest.raises(ValueError, match=r"."):
        decode(wrong, 3)
