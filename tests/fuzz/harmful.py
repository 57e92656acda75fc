"""What once did harm, or well might: by target and name. Made from valid inputs, so that it follows their formats.

Texts of this kind lie as files in ``corpus``.
"""

import io
import pickle
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from datetime import timedelta
from functools import cache
from typing import Any

import msgpack
import numpy as np
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

from protocols.mission.reading import MAX_BYTES
from protocols.wire.frames import FIXED, MAX_FRAME_BYTES, MAX_KNOWN, altered
from protocols.wire.heard import pack_heard
from protocols.wire.messages import Hello, Ready, Refused, Reply, Wait, Welcome, make_tick, pack
from tests.fuzz import seeds
from tests.fuzz.seeds import AGENTS, made, packed

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
    good, deep = msgpack.unpackb(list(seeds.notes())[2]), 1
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
    good = list(seeds.frames())[1]
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
    whole = list(seeds.heard())[-1]
    yield "nothing-where-there-is-to-be-something", b"\xff"
    yield "more-than-is-said", bytes([1]) + whole[1:]
    for size in (2, 4, 100, len(whole) - 1):
        yield f"cut-off-after-{size}", whole[:size]


def statuses() -> Named:
    """Accounts with one field that cannot be."""
    good = msgpack.unpackb(next(seeds.statuses()))
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


def _rsa_key() -> str:
    key = rsa.generate_private_key(65537, 1024)
    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()).decode()


def logins() -> Named:
    """Logins with certificates that are another's, of another time, or none."""
    first, second = seeds.keys_of(seeds.TODAY).logins
    own, others = first.certificates, second.certificates
    assert own
    assert others
    for name, certificates in (
        ("key-of-another", replace(own, private_key=others.private_key)),
        ("certificate-of-another", others),
        ("authority-of-another", replace(own, authority=others.certificate)),
        ("two-certificates-in-one", replace(own, certificate=own.certificate + others.certificate)),
        ("key-of-another-kind", replace(own, private_key=_rsa_key())),
    ):
        yield name, replace(first, certificates=certificates).to_json().encode()
    for name, days in (("expired", -800), ("not-yet-valid", 800)):
        yield name, seeds.keys_of(seeds.TODAY + timedelta(days)).logins[0].to_json().encode()


def world_keys() -> Named:
    """The same for the world."""
    made_keys = seeds.keys_of(seeds.TODAY)
    world, drone = made_keys.world, made_keys.logins[0].certificates
    assert world.certificates
    assert drone
    yield "nobodys", replace(world, passwords=()).to_json().encode()
    yield "more-than-a-swarm", replace(world, passwords=("a",) * 251).to_json().encode()
    yield "certificate-of-a-drone", replace(world, certificates=drone).to_json().encode()
    key_of_drone = replace(world.certificates, private_key=drone.private_key)
    yield "key-of-a-drone", replace(world, certificates=key_of_drone).to_json().encode()
    yield "of-another-address", seeds.keys_of(seeds.TODAY, "10.9.9.9").world.to_json().encode()


def pieces() -> Named:
    """Messages without an end."""
    yield "never-ends", b"\x01abc|" * 500
    yield "nothing", b""


def missions() -> Named:
    """What would be too long for a file."""
    yield "longer-than-read", b"#" * (MAX_BYTES + 1)


def _array(array: Any, header: str | None = None) -> bytes:
    """An ``.npy`` file, which may say something else of itself."""
    out = io.BytesIO()
    np.save(out, array, allow_pickle=True)
    data = out.getvalue()
    if header is None:
        return data
    return (
        data[:8]
        + (len(header) + 1).to_bytes(2, "little")
        + header.encode()
        + b"\n"
        + data[10 + data[8] + 256 * data[9] :]
    )


def recordings() -> Named:
    """Recordings that are damaged, lie about themselves, or hold other arrays."""
    good, two = next(seeds.recordings()), np.zeros(2)
    with zipfile.ZipFile(io.BytesIO(good)) as kept:
        files = {name: kept.read(name) for name in kept.namelist()}

    def with_(method: int = zipfile.ZIP_DEFLATED, **changes: bytes | None) -> bytes:
        out = io.BytesIO()
        with zipfile.ZipFile(out, "w", method) as new:
            for name, content in {**files, **{f"{name}.npy": data for name, data in changes.items()}}.items():
                if content is not None:
                    new.writestr(zipfile.ZipInfo(name), content, method)
        return out.getvalue()

    def header(shape: str) -> str:
        return f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}"

    yield "array-of-a-trillion", with_(positions=_array(two, header("(500000000000, 1, 2)")))
    yield "array-of-negative-length", with_(positions=_array(two, header("(-1, 1, 2)")))
    yield "header-cut-off", with_(positions=_array(two, "{'descr': (((("))
    yield "header-nested", with_(positions=_array(two, "(" * 3000))
    yield "header-of-another-version", with_(positions=b"\x93NUMPY\x09\x00" + _array(two)[8:])
    yield (
        "header-of-version-2",
        with_(positions=b"\x93NUMPY\x02\x00" + _array(two)[8:10] + b"\0\0" + _array(two)[10:]),
    )
    yield "no-array", with_(positions=b"x")
    yield "array-missing", with_(slots=None)
    yield "number-is-a-list", with_(tick_s=_array(np.zeros(3)))
    yield "array-of-objects", with_(positions=_array(np.array([{}], object)))
    yield "array-of-text", with_(positions=_array(np.array(["a"])))
    yield "other-drones-in-slots", with_(slots=_array(np.zeros((3, 3), np.int16)))
    yield "positions-in-three-dimensions", with_(positions=_array(np.zeros((3, 2, 3))))
    yield "numbers-of-half-the-size", with_(positions=_array(np.zeros((3, 2, 2), np.float32)))
    yield "long-array-of-zeros", with_(positions=_array(np.zeros((60_000, 2, 2))))
    yield "packed-with-lzma", with_(zipfile.ZIP_LZMA)
    yield "cut-off", good[:300]
    yield "not-a-zip", b"x"
    yield "nothing", b""
    yield "one-array", _array(np.zeros(3))
    yield "one-array-of-a-trillion", _array(two, header("(1000000000000,)"))
    entry = good.index(b"PK\x01\x02")
    for name, place, value in (
        ("damaged-in-the-middle", 60, 255), ("zip-of-a-later-version", entry + 6, 95), ("encrypted", entry + 8, 1),
        ("packed-in-an-unknown-way", entry + 10, 99),
    ):  # fmt: skip
        yield name, good[:place] + bytes([value]) + good[place + 1 :]


class _Calls:
    def __reduce__(self) -> tuple[Any, ...]:
        return print, ("a checkpoint has called a function",)


def checkpoints() -> Named:
    """Checkpoints that are damaged or hold something else."""
    import torch

    from rsc_swarm.training.config import TrainingConfig

    config = TrainingConfig().model_dump_json()
    for name, state in {
        "a-list": [1], "a-tensor": torch.ones(1), "config-missing": {"version": 2}, "config-cut-off": {"version": 2,
        "config": config[:90]},
        "config-a-list": {"version": 2, "config": "[]"}, "config-a-number": {"version": 2, "config": 5},
        "config-nested": {"version": 2, "config": "[" * 3000}, "curve-missing": {"version": 2, "config": config,
        "learner": {}},
        "curve-a-number": {"version": 2, "config": config, "curve": 5, "learner": {}}, "names-are-numbers": {1: 2},
    }.items():  # fmt: skip
        out = io.BytesIO()
        torch.save(state, out)
        yield name, out.getvalue()
    yield "pickle-that-calls", pickle.dumps(_Calls(), protocol=2)
    yield "nothing", b""
    yield "not-a-zip", b"x"


def _weights_in(place: str) -> bytes:
    """A model whose weights lie in another file."""
    from onnx import TensorProto, helper

    weights = TensorProto(
        name="w", data_type=TensorProto.FLOAT, dims=[4, 4], data_location=TensorProto.EXTERNAL
    )
    for key, value in (("location", place), ("offset", "0"), ("length", "64")):
        weights.external_data.add(key=key, value=value)
    taken, given = (helper.make_tensor_value_info(name, TensorProto.FLOAT, ["B", 4]) for name in "xy")
    graph = helper.make_graph(
        [helper.make_node("MatMul", ["x", "w"], ["y"])], "g", [taken], [given], [weights]
    )
    model: bytes = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8
    ).SerializeToString()
    return model


def models() -> Named:
    """Model files that are damaged, or want more than they hold."""
    yield "weights-in-another-file", _weights_in("Makefile")
    yield "weights-in-another-folder", _weights_in("../w")
    yield "weights-anywhere", _weights_in("/etc/passwd")
    yield from descriptions()


def descriptions() -> Named:
    """Model files whose inputs or metadata are no text."""
    good = next(seeds.models())
    yield "nothing", b""
    yield "not-a-model", b"x"
    yield "cut-off", good[:200]
    yield "input-not-utf-8", good.replace(b"heard", b"\xffeard")
    yield "input-of-two-lines", good.replace(b"heard", b"he\nrd")
    yield "metadata-not-utf-8", good.replace(b"horizon", b"\xfforizon")


_MADE = {
    "frame": frames, "heard": heard, "note": notes, "status": statuses, "from-drone": from_drone,
    "from-world": from_world,
    "pieces": pieces, "login": logins, "world-keys": world_keys, "recording": recordings, "checkpoint": checkpoints,
    "model": models, "mission": missions, "description": descriptions,
}  # fmt: skip
_IN_MSGPACK = ("note", "status", "from-drone", "from-world")


@cache
def harmful(target: str) -> dict[str, bytes]:
    """By name, for the target called ``target``."""
    return {**(MSGPACK if target in _IN_MSGPACK else {}), **dict(_MADE[target]() if target in _MADE else ())}
