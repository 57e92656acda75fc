"""The kept corpus, read again: nothing undeclared is raised, nothing takes long, nothing grows. ``make fuzz`` looks for more.

The corpus holds what once did harm, named after what it is, and what reaches branches that valid inputs do not. Beside it a few
hundred inputs are made anew: valid ones with something wrong in them, always the same.
"""

import gc
import random
import time
import tracemalloc

import pytest

from tests.fuzz.reach import CORPUS, kept
from tests.fuzz.targets import TARGETS, Target, is_declared

LONGEST_S = 10.0  # of the processor's time for one input; the slowest takes half a second
MOST_BYTES = 100 << 20  # for one input
MOST_KEPT_BYTES = 20_000  # of all the corpus, after it has been read before
CHANGED = 150  # inputs made anew
LIBRARIES = ("checkpoint", "model", "description")  # read by libraries of others: fewer


def complaint(target: Target, data: bytes) -> str | None:
    """What is wrong with how the target reads this; None if nothing is."""
    tracemalloc.reset_peak()
    before, began = tracemalloc.get_traced_memory()[0], time.process_time()
    try:
        target.read(data)
    except Exception as error:
        if not is_declared(target, error):
            return f"{type(error).__name__}: {error}"
    if (took := time.process_time() - began) > LONGEST_S:
        return f"took {took:.1f} s"
    took_bytes = tracemalloc.get_traced_memory()[1] - before
    return f"took {took_bytes >> 20} MB" if took_bytes > MOST_BYTES else None


def growth(target: Target, inputs: dict[str, bytes]) -> int:
    """Bytes that are still held after all have been read once more."""
    gc.collect()
    before = tracemalloc.get_traced_memory()[0]
    for data in inputs.values():
        complaint(target, data)
    gc.collect()
    return tracemalloc.get_traced_memory()[0] - before


@pytest.mark.parametrize("name", TARGETS)
@pytest.mark.filterwarnings("ignore:Detected pickle protocol")
def test_nothing_that_is_kept_does_harm(name: str) -> None:
    target, inputs = TARGETS[name], kept(name)
    for data in inputs.values():  # modules are imported, kernels compiled
        complaint(target, data)
    tracemalloc.start()
    try:
        assert {label: told for label, data in inputs.items() if (told := complaint(target, data))} == {}
        assert any(growth(target, inputs) < MOST_KEPT_BYTES for _ in range(3))  # caches may grow once
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("name", TARGETS)
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_nothing_that_is_nearly_right_does_harm(name: str) -> None:
    target, draw = TARGETS[name], random.Random(name)
    seeds = list(target.seeds())
    for _ in range(CHANGED // 5 if name in LIBRARIES else CHANGED):
        data = target.change(draw.choice(seeds), draw)
        try:
            target.read(data)
        except Exception as error:
            if not is_declared(target, error):
                raise AssertionError(f"{type(error).__name__} from {data[:400]!r}") from error


def test_a_corpus_is_one_of_a_target_and_small() -> None:
    assert {folder.name for folder in CORPUS.iterdir()} <= set(TARGETS)
    for folder in CORPUS.iterdir():
        assert sum(file.stat().st_size for file in folder.iterdir()) < 64_000


def test_a_target_that_raises_something_else_is_told_of() -> None:
    def read(data: bytes) -> None:
        if data == b"slow":
            while time.process_time() < ends:
                pass
        if data == b"large":
            bytes(MOST_BYTES + 1)
        raise KeyError if data == b"undeclared" else ValueError

    ends = time.process_time() + LONGEST_S + 0.5
    target = Target(read, (ValueError,), tuple, lambda data, _: data, ())
    tracemalloc.start()
    try:
        assert complaint(target, b"declared") is None
        assert complaint(target, b"undeclared") == "KeyError: "
        assert complaint(target, b"large") == "took 100 MB"
    finally:
        tracemalloc.stop()
