"""Files that once did harm, or well might. Made from valid ones, so that they follow their formats."""

import io
import pickle
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from datetime import timedelta
from typing import Any

import numpy as np
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

from protocols.mission.reading import MAX_BYTES
from tests.fuzz import seed_files

Named = Iterator[tuple[str, bytes]]


def _rsa_key() -> str:
    key = rsa.generate_private_key(65537, 1024)
    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()).decode()


def logins() -> Named:
    """Logins with certificates that are another's, of another time, or none."""
    first, second = seed_files.keys_of(seed_files.TODAY).logins
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
        yield name, seed_files.keys_of(seed_files.TODAY + timedelta(days)).logins[0].to_json().encode()


def world_keys() -> Named:
    """The same for the world."""
    made_keys = seed_files.keys_of(seed_files.TODAY)
    world, drone = made_keys.world, made_keys.logins[0].certificates
    assert world.certificates
    assert drone
    yield "nobodys", replace(world, passwords=()).to_json().encode()
    yield "more-than-a-swarm", replace(world, passwords=("a",) * 251).to_json().encode()
    yield "certificate-of-a-drone", replace(world, certificates=drone).to_json().encode()
    key_of_drone = replace(world.certificates, private_key=drone.private_key)
    yield "key-of-a-drone", replace(world, certificates=key_of_drone).to_json().encode()
    yield "of-another-address", seed_files.keys_of(seed_files.TODAY, "10.9.9.9").world.to_json().encode()


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
    good, two = next(seed_files.recordings()), np.zeros(2)
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
    good = next(seed_files.models())
    yield "nothing", b""
    yield "not-a-model", b"x"
    yield "cut-off", good[:200]
    yield "input-not-utf-8", good.replace(b"heard", b"\xffeard")
    yield "input-of-two-lines", good.replace(b"heard", b"he\nrd")
    yield "metadata-not-utf-8", good.replace(b"horizon", b"\xfforizon")
