"""Messages that once did harm, or well might. Made from valid ones, so that they follow their formats."""

from collections.abc import Iterator
from typing import Any

import msgpack
import numpy as np

from protocols.wire.frames import FIXED, MAX_FRAME_BYTES, MAX_KNOWN, altered
from protocols.wire.heard import pack_heard
from protocols.wire.messages import Hello, Ready, Refused, Reply, Wait, Welcome, make_tick, pack
from tests.fuzz import seed_messages
from tests.fuzz.seed_messages import AGENTS, made, packed

Named = Iterator[tuple[str, bytes]]

MSGPACK = {
    "nothing": b"", "nested-1000-deep": b"\x91" * 1000 + b"\x01", "list-of-4-billion": b"\xdd\xff\xff\xff\xff",
    "mapping-of-4-billion": b"\xdf\xff\xff\xff\xff", "list-as-a-key": b"\x81\x90\x01", "text-not-utf-8": b"\xa1\xff",
    "time-stamp": b"\xd6\xff\xff\xff\xff\xff", "unused-code": b"\xc1", "cut-off": b"\x96\x01", "two-objects": b"\x01\x02",
    "a-number": b"\x01", "an-empty-list": b"\x90", "a-text": b"\xa3abc",
}  # fmt: skip


def _with(fields: list[Any], place: int, value: Any) -> list[Any]:
    return [*fields[:place], value, *fields[place + 1 :]]


def notes() -> Named:
    """Slot notes with one field that cannot be."""
    good, deep = msgpack.unpackb(list(seed_messages.notes())[2]), 1
    for _ in range(400):
        deep = [deep]  # type: ignore[assignment]
    swap, seal = good[6][0], good[4][3]
    for name, place, value in (
        ("a-nested-digest", 0, deep), ("proposal-of-two-numbers", 3, [1, 2]),
        ("a-truth-for-a-number", 1, True), ("proposal-to-its-own-slot", 3, [1, 2, 3, 3, 0]),
        ("counter-at-its-end", 4, [2, 5, 2**56 - 1, seal]), ("counter-beyond-its-end", 4, [2, 5, 2**56, seal]),
        ("half-a-seal", 4, [2, 5, 9, seal[:32]]), ("seal-is-a-number", 4, [2, 5, 9, 5]), ("no-acceptance", 4, []),
        ("too-many-refusals", 5, [[1, 2]] * 9),
        ("counter-zero", 6, [_with(swap, 0, 0)]), ("too-many-swaps", 6, [swap] * 17),
        ("swap-with-itself", 6, [_with(swap, 4, swap[1])]), ("three-seals", 6, [_with(swap, 6, 3 * seal)]),
        ("no-swap", 6, [[]]),
        ("set-of-more-than-all", 7, b"\xff"), ("set-of-too-many-bytes", 7, bytes(2)), ("set-is-a-number", 7, 5),
        ("assignment-not-a-permutation", 8, [bytes(AGENTS), 1, 2]), ("assignment-of-other-agents", 8, [bytes(5), 1, 2]),
    ):  # fmt: skip
        yield name, packed(_with(good, place, value))
    yield "eight-fields", packed(good[:8])


def _patched(data: bytes, field: str, value: Any) -> bytes:
    record = np.frombuffer(data, FIXED, 1).copy()
    record[field] = value
    return record.tobytes() + data[FIXED.itemsize :]


def frames() -> Named:
    """Frames with one part that cannot be."""
    good = list(seed_messages.frames())[1]
    for name, field, value in (
        ("another-version", "version", 99), ("another-swarm", "tag", 0), ("neither-loud-nor-quiet", "loud", 2),
        ("from-the-future", "tick", 2000), ("from-long-ago", "tick", 1), ("motion-not-finite", "motion", np.nan),
        ("ages-of-nobody", "age_from", AGENTS), ("a-slot-nobody-has", "slot", AGENTS),
        ("a-sender-nobody-is", "sender", AGENTS), ("more-hops-than-known", "one_hop", 9),
        ("knows-more-than-can-be", "known_count", MAX_KNOWN + 1), ("knows-more-than-is-there", "known_count", MAX_KNOWN),
        ("a-note-in-a-quiet-frame", "loud", 0),
    ):  # fmt: skip
        yield name, _patched(good, field, value)
    yield "record-is-cut-off", good[: FIXED.itemsize - 1]
    yield "displacements-are-cut-off", good[: FIXED.itemsize + 11]
    yield "loud-and-says-nothing", _patched(altered(good, note=b""), "loud", 1)
    yield "oversized", bytes(MAX_FRAME_BYTES + 1)
    for name, note in notes():
        yield f"note-with-{name}", altered(good, note=note)
    for name, note in MSGPACK.items():
        yield f"note-is-{name}", altered(good, note=note)


def heard() -> Named:
    """What is heard, cut off or longer than it says."""
    for name, frame in frames():
        if len(frame) < 2**16:
            yield f"frame-{name}", bytes([2]) + pack_heard([(1, frame), (2, frame)])
    whole = list(seed_messages.heard())[-1]
    yield "nothing-where-there-is-to-be-something", b"\xff"
    yield "more-than-is-said", bytes([1]) + whole[1:]
    for size in (2, 4, 100, len(whole) - 1):
        yield f"cut-off-after-{size}", whole[:size]


def statuses() -> Named:
    """Accounts with one field that cannot be."""
    good = msgpack.unpackb(next(seed_messages.statuses()))
    for name, place, value in (
        ("number-where-counts-are-listed", 2, 5), ("text-where-counts-are-listed", 3, "1234567"),
        ("nothing-where-counts-are-listed", 3, None),
        ("counts-of-another-version", 2, [1]), ("view-of-others", 5, bytes(5)), ("view-is-text", 5, "abcdef"),
        ("slot-is-half", 0, 0.5),
        ("count-below-zero", 1, -1), ("truth-for-a-number", 1, True),
    ):  # fmt: skip
        yield name, packed(_with(good, place, value))


def from_drone() -> Named:
    """Messages that no drone says."""
    good = Reply(7, 3, 9, 0.5, 0.5, 5, b"x", None)
    for name, reply in (
        ("not-a-number", good._replace(ax=float("nan"))), ("absurd-acceleration", good._replace(ay=1e9)),
        ("frame-too-long", good._replace(frame=bytes(2000))), ("tick-beyond-the-last", good._replace(tick=2**31)),
        ("slot-nobody-has", good._replace(slot=AGENTS)), ("account-is-a-number", good._replace(status=5)),
    ):  # fmt: skip
        yield name, pack(reply)  # type: ignore[arg-type]
    for size in (1, 39, 40):
        yield f"reply-of-{size}-bytes", pack(good)[:size]
    yield "reply-and-more", pack(good) + b"x"
    for name, account in statuses():
        yield f"account-with-{name}", pack(good._replace(status=msgpack.unpackb(account)))
    yield "process-too-large", made(Ready, process=2**32)
    yield "version-is-text", made(Hello, version="1", process=1)
    yield "what-the-world-says", made(Wait)
    yield "kind-unknown", packed([99])
    yield "kind-is-a-truth", packed([True])
    yield "too-few-fields", packed([1])
    yield "longer-than-any", bytes(70_000)


def from_world() -> Named:
    """Messages that no world says."""
    tick = make_tick(3, 9, 2, (bytes(32), bytes(80), bytes(24)), [1], [b"x"]).data
    for name, place, value in (
        ("obstacles-beyond-all", 1, 255), ("neighbours-beyond-all", 2, 255), ("neighbours-beyond-the-end", 2, 5),
        ("tick-beyond-the-last", 7, 255), ("hears-more-than-is-there", 16, 9), ("frame-beyond-the-end", -3, 9),
    ):  # fmt: skip
        patched = bytearray(tick)
        patched[place] = value
        yield name, bytes(patched)
    for size in (1, 19, 20, 51, 155, len(tick) - 1):
        yield f"tick-of-{size}-bytes", tick[:size]
    welcome = {"process": 7, "initial_slots": b"", "boot": 0, "flight": bytes(8), "datagram_key": b""}
    yield "mission-of-a-list", made(Welcome, **welcome, mission={"agents": [3]})
    yield "mission-with-a-long-text", made(Welcome, **welcome, mission={"policy": "a" * 5000})
    yield "mission-is-text", made(Welcome, **welcome, mission="x")
    yield "flight-is-too-short", made(Welcome, **{**welcome, "flight": bytes(7)}, mission={})
    yield "refusal-is-a-number", made(Refused, process=7, why=5)
    yield "what-a-drone-says", made(Ready, process=7)
    yield "kind-unknown", packed([99])
    yield "kind-is-a-truth", packed([True])
    yield "too-few-fields", packed([5])


def pieces() -> Named:
    """Messages without an end."""
    yield "never-ends", b"\x01abc|" * 500
    yield "nothing", b""
