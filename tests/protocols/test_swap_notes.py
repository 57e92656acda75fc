"""Slot notes from the air: what is believed, and what is an error."""

from __future__ import annotations

from typing import Any

import msgpack
import pytest

from protocols.slots.history import Checkpoint, Mark, Swap
from protocols.slots.notes import Acceptance, Proposal, Refusal, SlotNote, decode, encode

FULL = SlotNote(
    digest=2**64 - 1,
    settled=False,
    amnesiac=True,
    proposal=Proposal(1, 7, 0, 1),
    acceptance=Acceptance(2, 9, 4),
    refusals=(Refusal(1, 3),),
    mark=Mark(2, 5),
    ops=(Swap(3, 0, 1, 0, 0, 1, 1),),
    had=0b101,
    checkpoint=Checkpoint((2, 0, 1), 6, clock=1, size=1),
)


@pytest.mark.parametrize("note", [FULL, SlotNote(5, True), SlotNote(5, False)])
def test_notes_survive_the_air(note: SlotNote) -> None:
    assert decode(msgpack.unpackb(msgpack.packb(encode(note))), 3) == note


WRONG: list[tuple[int, Any]] = [
    (0, -1),
    (0, 2**64),
    (0, 1.0),
    (0, True),
    (1, 2),
    (1, None),
    (2, 2),
    (3, [1, 7, 0]),
    (3, [3, 7, 0, 1]),
    (3, [1, 7, 1, 1]),
    (3, "abcd"),
    (3, [1, True, 0, 1]),
    (4, [3, 9, 4]),
    (4, [2, 9]),
    (5, None),
    (5, [[1, 3]] * 9),
    (6, [2, -5]),
    (7, [[0, 0, 1, 0, 0, 1, 1]]),
    (7, [[3, 0, 1, 0, 0, 0, 1]]),
    (7, [[3, 0, 1, 0, 0, 3, 1]]),
    (7, [[3, 0, 1, 0, 0, 1, 1]] * 17),
    (7, [[2**48, 0, 1, 0, 0, 1, 1]]),
    (8, 5),
    (8, b"\x08"),
    (8, b"\1\0"),
    (9, []),
    (9, [b"\0\0\1", 6, 1, 1]),
    (9, [b"\0\1", 6, 1, 1]),
    (9, [[0, 1, 2], 6, 1, 1]),
    (9, [b"\0\1\2", 6, 1]),
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
