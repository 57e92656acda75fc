"""Who occupies which slot: a set of ordered swaps, folded."""

from __future__ import annotations

import random

import pytest

from protocols.slots.history import Checkpoint, Mark, SlotBook, Swap, hash_swap


def swap(counter: int, a: int, b: int, slot_a: int, slot_b: int, nonce: int = 1) -> Swap:
    """Agents a (the initiator) and b exchange their slots."""
    return Swap(counter, a, nonce, slot_a, a, slot_b, b)


NEAR = swap(1, 0, 1, 0, 1)
FAR = swap(1, 2, 3, 2, 3)
THEN = swap(2, 1, 2, 0, 3)  # possible only after both


def book_of(*ops: Swap, n: int = 4) -> SlotBook:
    book = SlotBook(range(n))
    for op in ops:
        book.add(op)
    return book


def test_a_swap_exchanges_the_occupants() -> None:
    book = book_of(NEAR)
    assert book.slot_of == (1, 0, 2, 3)
    assert book.occupant == (1, 0, 2, 3)
    assert (book.clock, book.count, book.open) == (1, 1, (NEAR,))


def test_any_permutation_may_be_the_start() -> None:
    book = SlotBook([2, 0, 1])
    assert book.slot_of == (2, 0, 1)
    assert book.occupant == (1, 2, 0)


def test_a_swap_is_learned_once() -> None:
    book = book_of(NEAR, FAR)
    assert not book.add(NEAR)
    assert not book.add(FAR)
    assert book.count == 2


def test_order_of_arrival_does_not_matter() -> None:
    known = {book_of(*ops).slot_of for ops in [(NEAR, FAR, THEN), (THEN, FAR, NEAR), (FAR, THEN, NEAR)]}
    assert known == {(1, 3, 0, 2)}
    assert book_of(NEAR, FAR, THEN).digest == book_of(THEN, NEAR, FAR).digest


def test_of_two_swaps_of_one_slot_the_earlier_wins() -> None:
    late, early = swap(1, 1, 2, 1, 2), swap(1, 0, 1, 0, 1)
    book = book_of(late)
    assert book.slot_of == (0, 2, 1, 3)
    book.add(early)
    assert book.slot_of == (1, 0, 2, 3)
    assert book.skipped == {late}


def test_far_swaps_of_one_moment_both_survive() -> None:
    assert book_of(NEAR, FAR).slot_of == (1, 0, 3, 2)


def test_every_set_of_swaps_gives_a_permutation_and_equal_sets_equal_views() -> None:
    draw = random.Random(7)
    for _ in range(300):
        n = draw.randint(2, 6)
        ops = []
        for serial in range(draw.randint(0, 8)):
            (a, b), (s, t) = draw.sample(range(n), 2), draw.sample(range(n), 2)
            ops.append(Swap(draw.randint(1, 4), a, serial, s, a, t, b))
        one, other = book_of(*ops, n=n), book_of(*draw.sample(ops, len(ops)), n=n)
        assert sorted(one.slot_of) == list(range(n))
        assert (one.slot_of, one.digest, one.skipped) == (other.slot_of, other.digest, other.skipped)
        assert all(one.slot_of[agent] == slot for slot, agent in enumerate(one.occupant))


@pytest.mark.parametrize(
    "wrong",
    [
        Swap(1, 4, 1, 0, 0, 1, 1),
        Swap(1, 0, 1, -1, 0, 1, 1),
        Swap(1, 0, 1, 0, 0, 4, 1),
        Swap(1, 0, 1, 0, 0, 1, 9),
        Swap(1, 0, 1, 1, 0, 1, 1),
        Swap(1, 0, 1, 0, 0, 1, 0),
        Swap(0, 0, 1, 0, 0, 1, 1),
    ],
)
def test_a_swap_of_what_does_not_exist_is_an_error_and_changes_nothing(wrong: Swap) -> None:
    book = book_of(NEAR)
    before = vars(book.copy())
    with pytest.raises(ValueError, match=r"no such|not a swap"):
        book.add(wrong)
    assert vars(book) == before


@pytest.mark.parametrize("wrong", [[], [0, 0], [1, 2], range(256)])
def test_the_start_is_a_permutation_that_fits_a_byte(wrong: list[int]) -> None:
    with pytest.raises(ValueError, match="assignment"):
        SlotBook(wrong)


def test_books_of_another_start_differ() -> None:
    assert SlotBook([0, 1, 2]).digest != SlotBook([1, 0, 2]).digest


def test_the_digest_is_the_same_on_every_machine() -> None:
    assert hash_swap(NEAR) == 0x51E09AB14F11268B
    assert SlotBook(range(3)).digest == 0x36A4A06801C279E8


def test_folding_changes_neither_view_nor_digest() -> None:
    book, plain = book_of(NEAR, FAR, THEN), book_of(NEAR, FAR, THEN)
    assert book.fold(2) == 2
    assert book.open == (THEN,)
    assert book.base == Checkpoint((1, 0, 3, 2), book_of(NEAR, FAR).digest, clock=1, size=2)
    same = ("slot_of", "occupant", "digest", "clock", "count")
    assert all(getattr(book, name) == getattr(plain, name) for name in same)
    assert not book.add(NEAR), "a folded swap is known"


def test_a_checkpoint_never_parts_equal_counters() -> None:
    book = book_of(NEAR, FAR, THEN)
    assert book.fold(1) == 0
    assert book.fold(99) == 3
    assert book.open == ()


def test_a_swap_older_than_the_checkpoint_is_ignored() -> None:
    book = book_of(NEAR, THEN)
    book.fold(2)
    digest = book.digest
    assert not book.add(FAR)
    assert book.digest == digest


def test_a_later_swap_goes_on_from_the_checkpoint() -> None:
    book = book_of(NEAR, FAR)
    book.fold(2)
    book.add(THEN)
    assert book.slot_of == book_of(NEAR, FAR, THEN).slot_of


def test_a_larger_checkpoint_that_is_a_prefix_only_folds() -> None:
    ahead, behind = book_of(NEAR, FAR), book_of(NEAR, FAR, THEN)
    ahead.fold(2)
    assert behind.has_prefix(ahead.base.mark)
    assert not behind.adopt(ahead.base)
    assert behind.base == ahead.base
    assert behind.slot_of == book_of(NEAR, FAR, THEN).slot_of


def test_a_foreign_checkpoint_is_adopted_whole() -> None:
    book, other = book_of(FAR, THEN), book_of(NEAR)
    other.fold(1)
    assert book.adopt(other.base)
    assert book.base == other.base
    assert book.open == (THEN,), "only what counts more than the checkpoint is kept"
    assert book.skipped == {THEN}
    assert not other.has_prefix(Mark(1, book_of(FAR).digest))


def test_a_checkpoint_that_parts_my_equal_counters_is_foreign() -> None:
    book, other = book_of(NEAR, FAR, THEN), book_of(NEAR)
    other.fold(1)
    assert book.prefix_digest(1) == other.base.digest
    assert not book.has_prefix(other.base.mark)
    assert book.adopt(other.base)
    assert book.open == (THEN,)


def test_equal_checkpoints_change_nothing() -> None:
    book, other = book_of(NEAR, FAR), book_of(NEAR, FAR)
    book.fold(2)
    other.fold(2)
    assert not book.adopt(other.base)


def test_of_two_checkpoints_the_larger_prevails() -> None:
    book, smaller = book_of(NEAR, FAR), book_of(THEN)
    book.fold(2)
    smaller.fold(1)
    assert not book.adopt(smaller.base)
    assert book.slot_of == (1, 0, 3, 2)
    assert smaller.adopt(book.base)
    assert smaller.slot_of == (1, 0, 3, 2)


def test_of_two_checkpoints_of_one_size_the_larger_digest_prevails() -> None:
    one, other = book_of(NEAR), book_of(FAR)
    for book in (one, other):
        book.fold(1)
    bases = {one.base, other.base}
    assert one.adopt(other.base) != other.adopt(one.base)
    assert one.base == other.base == max(bases, key=lambda base: base.mark)


def test_a_checkpoint_must_be_a_permutation() -> None:
    book = book_of(NEAR)
    with pytest.raises(ValueError, match="permutation"):
        book.adopt(Checkpoint((0, 0, 1, 2), 5, clock=9, size=9))
    assert book.slot_of == (1, 0, 2, 3)


def test_a_copy_goes_its_own_way() -> None:
    book = book_of(NEAR)
    twin = book.copy()
    twin.add(FAR)
    assert (book.count, twin.count) == (1, 2)
