"""Who occupies which slot: a set of ordered swaps, folded."""

from __future__ import annotations

import random

import pytest

from protocols.slots.history import MAX_LEAP, MAX_TAKEN, SlotBook, Swap, hash_swap, is_permutation
from protocols.slots.written import pack_slots, unpack_slots


def swap(counter: int, a: int, b: int, slot_a: int, slot_b: int, nonce: int = 1) -> Swap:
    """Agents a (the initiator) and b exchange their slots."""
    return Swap(counter, a, nonce, slot_a, b, slot_b)


def take(counter: int, a: int, dead: int, slot_a: int, slot_b: int, nonce: int = 1) -> Swap:
    """Agent a takes the slot of a dead one."""
    return Swap(counter, a, nonce, slot_a, dead, slot_b, taken=True)


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
    assert (book.clock, book.count, book.open) == (1, 1, (NEAR,))


def test_any_permutation_may_be_the_start() -> None:
    book = SlotBook([2, 0, 1])
    assert book.slot_of == (2, 0, 1)


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
            ops.append(Swap(draw.randint(1, 4), a, serial, s, b, t, draw.random() < 0.4))
        one, other = book_of(*ops, n=n), book_of(*draw.sample(ops, len(ops)), n=n)
        assert sorted(one.slot_of) == list(range(n))
        assert (one.slot_of, one.digest, one.skipped) == (other.slot_of, other.digest, other.skipped)


@pytest.mark.parametrize(
    "wrong",
    [
        Swap(1, 4, 1, 0, 1, 1),
        Swap(1, 0, 1, -1, 1, 1),
        Swap(1, 0, 1, 0, 1, 4),
        Swap(1, 0, 1, 0, 9, 1),
        Swap(1, 0, 1, 1, 1, 1),
        Swap(1, 0, 1, 0, 0, 1),
        Swap(0, 0, 1, 0, 1, 1),
    ],
)
def test_a_swap_of_what_does_not_exist_is_an_error_and_changes_nothing(wrong: Swap) -> None:
    book = book_of(NEAR)
    before = vars(book.copy())
    with pytest.raises(ValueError, match=r"no such|not a swap"):
        book.add(wrong)
    assert vars(book) == before


@pytest.mark.parametrize("wrong", [[], [0, 0], [1, 2]])
def test_the_start_is_a_permutation(wrong: list[int]) -> None:
    with pytest.raises(ValueError, match="assignment"):
        SlotBook(wrong)


def test_books_of_another_start_differ() -> None:
    assert SlotBook([0, 1, 2]).digest != SlotBook([1, 0, 2]).digest


def test_the_digest_is_the_same_on_every_machine() -> None:
    assert hash_swap(NEAR) == 0xEB9CC73334BFD552
    assert SlotBook(range(3)).digest == 0x36A4A06801C279E8


def test_settling_changes_neither_view_nor_digest_and_forgets_nothing() -> None:
    book, plain = book_of(NEAR, FAR), book_of(NEAR, FAR)
    book.settle()
    assert book.open == ()
    for one in (book, plain):
        one.add(THEN)
    assert book.open == (THEN,)
    same = ("slot_of", "digest", "clock", "count", "ops")
    assert all(getattr(book, name) == getattr(plain, name) for name in same)
    assert not book.add(NEAR)


def test_a_swap_that_comes_late_unsettles_those_after_it() -> None:
    book = book_of(NEAR, THEN)
    book.settle()
    assert book.add(FAR)
    assert book.open == (FAR, THEN)
    assert book.slot_of == book_of(NEAR, FAR, THEN).slot_of


# Slots of the dead


def test_a_slot_is_taken() -> None:
    assert book_of(take(1, 1, 0, 1, 0), take(2, 2, 0, 2, 1)).slot_of == (2, 0, 1, 3)


def test_what_was_taken_does_not_undo_what_was_agreed() -> None:
    """Agent 0 was not dead: it has agreed to a swap since, or at the same moment. Whenever that is heard, the swap holds."""
    for counter in (1, 2, 3):
        taken, agreed = take(counter, 1, 0, 1, 0), swap(2, 0, 3, 0, 3)
        for book in (book_of(taken, agreed), book_of(agreed, taken)):
            assert book.slot_of == (3, 1, 2, 0)
            assert book.skipped == {taken}


def test_a_taker_that_has_agreed_to_another_swap_from_its_old_place_has_not_taken_it() -> None:
    backdated, agreed = take(1, 1, 0, 1, 0), swap(2, 1, 2, 1, 2)
    assert book_of(agreed, backdated).skipped == {backdated}


def test_who_comes_back_and_agrees_to_a_swap_from_its_new_place_has_lost_its_old_one() -> None:
    ops = take(1, 1, 0, 1, 0), take(2, 2, 0, 2, 1), swap(3, 0, 3, 2, 3)
    assert book_of(*ops).slot_of == (3, 0, 1, 2)
    assert book_of(*ops).skipped == frozenset()


def test_of_the_slots_that_one_agent_took_the_first_count_in_whatever_order_they_are_heard() -> None:
    draw = random.Random(3)
    ops = [take(counter, 1, 0, 1, 0, nonce=counter) for counter in range(1, 2 * MAX_TAKEN)]
    books = [book_of(*draw.sample(ops, len(ops))) for _ in range(20)]
    assert {book.ops for book in books} == {tuple(ops[:MAX_TAKEN])}
    assert {book.digest for book in books} == {book_of(*ops[:MAX_TAKEN]).digest}


def test_nobody_takes_a_slot_in_the_far_future() -> None:
    absurd, far = take(2**56 - 1, 1, 0, 1, 0), take(MAX_LEAP, 1, 0, 1, 0)
    assert not book_of().add(absurd)
    assert book_of(far).clock == MAX_LEAP
    book = book_of(far)
    assert book.counter_of_taking(3, 2) == 1, "who has nothing to do with it need not count more"
    assert book.counter_of_taking(3, 0) == MAX_LEAP + 1


def test_a_copy_goes_its_own_way() -> None:
    book = book_of(NEAR)
    twin = book.copy()
    twin.add(FAR)
    assert (book.count, twin.count) == (1, 2)


@pytest.mark.parametrize("agents", [1, 255, 256, 257, 1024])
def test_an_assignment_of_any_size_comes_back_from_its_bytes(agents: int) -> None:
    slot_of = tuple(reversed(range(agents)))
    data = pack_slots(slot_of)
    assert tuple(unpack_slots(data, agents)) == slot_of
    assert len(data) == (agents if agents <= 256 else 2 * agents)
    assert is_permutation(unpack_slots(data, agents))
    assert is_permutation(unpack_slots(bytes(len(data)), agents)) == (agents == 1)
    for wrong in (data[:-1], data + b"\0", b"", list(data), None):
        with pytest.raises(ValueError, match=f"an assignment of {agents} slots has {len(data)} bytes"):
            unpack_slots(wrong, agents)
