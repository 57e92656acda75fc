"""Inputs that get deep: what is valid, with something wrong in it.

Bytes alone rarely get past a format's grammar. Here an input is read as a tree in its own form (msgpack, JSON, YAML, a zip of
arrays), the tree is changed in a few places, and written again. The result is an ordinary input: it can be kept and read again
without anything of this file.
"""

import base64
import io
import json
import random
import zipfile
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from typing import Any, NamedTuple

import msgpack

from protocols.mission.reading import ReadingError, read_yaml
from tests.fuzz.nasty import HEADERS, NUMBERS, RAW_JSON, RAW_MSGPACK, RAW_YAML, TEXTS

Change = Callable[[bytes, random.Random], bytes]

PLACEHOLDER = "@here@"
_GOES_DOWN = 0.8  # of all steps of a walk to the place of a change
_MOST_MORE = 20_000  # values and letters that one change adds


class Raw(NamedTuple):
    """Stands in a tree for something that only its text can say."""

    place: str


def bytes_changed(data: bytes, draw: random.Random) -> bytes:
    """A few bytes other than they were, moved, doubled or gone."""
    out = bytearray(data)
    for _ in range(draw.choice((1, 1, 1, 2, 4))):
        at, length = draw.randint(0, len(out)), draw.choice((1, 1, 2, 4, 8, 16))
        kind = draw.randrange(6)
        if kind == 0:
            out[at : at + length] = draw.randbytes(length)
        elif kind == 1:
            out[at:at] = draw.choice((draw.randbytes(length), b"\0" * length, b"\xff" * length))
        elif kind == 2:
            del out[at : at + length]
        elif kind == 3 and at < len(out):
            out[at] ^= 1 << draw.randrange(8)
        elif kind == 4:
            out[at:at] = out[draw.randint(0, len(out)) :][: 4 * length]
        else:
            out[at:] = b"" if draw.random() < 0.3 else out[at:]
    return bytes(out)


def _place(root: list[Any], draw: random.Random) -> tuple[Any, Any]:
    """A (list or mapping, index) in a tree, whose top is root[0]: found on a walk down, so it costs the same in a large one."""
    inner, key = root, 0
    while (below := inner[key]) and isinstance(below, (dict, list)) and draw.random() < _GOES_DOWN:
        inner, key = below, draw.choice(list(below) if isinstance(below, dict) else range(len(below)))
    return inner, key


def _leaf(draw: random.Random) -> Any:
    return draw.choice(
        (
            lambda: draw.choice(NUMBERS),
            lambda: draw.choice(NUMBERS),
            lambda: draw.choice(TEXTS),
            lambda: draw.choice((None, True, False, [], {}, b"", bytes(32), [[1]], {"a": {}})),
            lambda: draw.randbytes(draw.choice((1, 4, 6, 25, 32, 68))),
            lambda: Raw(PLACEHOLDER),
        )
    )()


def _near(value: Any, draw: random.Random) -> Any:
    """Something of the same kind."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return draw.choice(
            (value + 1, value - 1, -value, 2 * value, draw.choice(NUMBERS), float(min(abs(value), 2**60)))
        )
    if isinstance(value, float):
        return draw.choice((value * 10, -value, value + 1, draw.choice(NUMBERS), draw.random()))
    if isinstance(value, str) and value.startswith("-----BEGIN") and draw.random() < 0.7:
        return _pem_changed(value, draw)
    if isinstance(value, str):
        at = draw.randint(0, len(value))
        return draw.choice(
            (
                value[:at] + draw.choice(TEXTS) + value[at:],
                value[:at],
                value * 2,
                value.upper(),
                draw.choice(TEXTS),
            )
        )
    if isinstance(value, bytes):
        return bytes_changed(value, draw)
    return _leaf(draw)


def _pem_changed(text: str, draw: random.Random) -> str:
    """A certificate or key with other bytes in it."""
    try:
        first, *lines, last = text.strip().split("\n")
        inside = base64.b64decode("".join(lines))
    except ValueError:  # it has been changed before
        return text[: draw.randint(0, len(text))]
    changed = base64.b64encode(bytes_changed(inside, draw)).decode()
    return "\n".join([first, *(changed[at : at + 64] for at in range(0, len(changed), 64)), last, ""])


def _changed(tree: Any, draw: random.Random) -> Any:
    root = [tree]
    for _ in range(draw.choice((1, 1, 1, 2, 3, 6))):
        inner, key = _place(root, draw)
        kind = draw.randrange(9)
        if kind < 3:
            inner[key] = _near(inner[key], draw)
        elif kind == 3:
            inner[key] = _leaf(draw)
        elif kind == 4:
            other, from_ = _place(root, draw)
            inner[key] = json_copy(other[from_])
        elif kind == 5 and inner is not root:
            del inner[key]
        elif kind == 6 and isinstance(inner, list) and inner is not root:
            times = draw.choice((1, 1, 2, 20))
            if (
                times * _size(inner[key]) <= _MOST_MORE
            ):  # twenty times what has been made twenty times, and so on
                inner[key:key] = [json_copy(inner[key])] * times
        elif kind == 7 and isinstance(inner, dict):
            inner[draw.choice(TEXTS) if draw.random() < 0.5 else str(key) + draw.choice(TEXTS)] = _leaf(draw)
        else:
            inner[key] = draw.choice(([inner[key]], {"a": inner[key]}, [inner[key], inner[key]]))
    return root[0]


def _size(tree: Any) -> int:
    """Lists, mappings and values in it, and letters of its texts."""
    below = tree.values() if isinstance(tree, dict) else tree if isinstance(tree, list) else ()
    return 1 + sum(map(_size, below)) + (len(tree) if isinstance(tree, (str, bytes)) else 0)


def json_copy(tree: Any) -> Any:
    """A copy that shares no list or mapping."""
    if isinstance(tree, dict):
        return {key: json_copy(value) for key, value in tree.items()}
    return [json_copy(value) for value in tree] if isinstance(tree, list) else tree


def _text(data: bytes) -> str:
    return data.decode("utf-8", "surrogateescape")


def _as_json(tree: Any, draw: random.Random, raw: tuple[str, ...]) -> bytes:
    def other(value: Any) -> Any:
        return PLACEHOLDER if isinstance(value, Raw) else value.decode("latin-1")

    text = json.dumps(
        _spelled(tree), default=other, indent=draw.choice((None, None, 1)), ensure_ascii=draw.random() < 0.5
    )
    return text.replace(f'"{PLACEHOLDER}"', draw.choice(raw)).encode("utf-8", "surrogatepass")


def _spelled(tree: Any) -> Any:
    """The tree with its `Raw` places as text: to JSON a named tuple is a list."""
    if isinstance(tree, Raw):
        return PLACEHOLDER
    if isinstance(tree, dict):
        return {key: _spelled(value) for key, value in tree.items()}
    return [_spelled(value) for value in tree] if isinstance(tree, list) else tree


def json_changed(data: bytes, draw: random.Random) -> bytes:
    """JSON with something wrong in it."""
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):
        return bytes_changed(data, draw)
    return _as_json(_changed(tree, draw), draw, RAW_JSON)


def lines_changed(data: bytes, draw: random.Random) -> bytes:
    """JSON lines, one of them with something wrong in it."""
    lines = data.split(b"\n")
    at = draw.randrange(len(lines))
    lines[at] = draw.choice((json_changed, bytes_changed))(lines[at], draw).replace(b"\n", b" ")
    if draw.random() < 0.2:
        lines.insert(draw.randint(0, len(lines)), draw.choice(lines))
    return draw.choice((b"\n", b"\n", b"\n", b"\r\n", b"\r", "\u2028".encode())).join(lines)


def yaml_changed(data: bytes, draw: random.Random) -> bytes:
    """YAML with something wrong in it."""
    tree = _yaml_tree(data) if draw.random() < 0.8 else None
    if not isinstance(tree, dict | list):
        out, at = bytes_changed(data, draw), draw.randint(0, len(data))
        raw = draw.choice(RAW_YAML).encode("utf-8", "surrogatepass")
        return out[:at] + raw + out[at:] if draw.random() < 0.5 else out
    return _as_json(_changed(json_copy(tree), draw), draw, RAW_YAML)


@lru_cache(maxsize=4096)  # what is changed has mostly been changed before
def _yaml_tree(data: bytes) -> Any:
    """What it says; None if it is broken. JSON, as which trees are written here, is read as such: in a hundredth of the time."""
    with suppress(ValueError, RecursionError):
        return json.loads(data)
    with suppress(ReadingError):
        return read_yaml(_text(data))
    return None


def msgpack_changed(data: bytes, draw: random.Random) -> bytes:
    """A msgpack message with something wrong in it."""
    try:
        tree = msgpack.unpackb(data, strict_map_key=False)
        raw = draw.choice(RAW_MSGPACK)
        packed: bytes = msgpack.packb(
            _changed(tree, draw),
            default=lambda _: PLACEHOLDER,
            unicode_errors="surrogatepass",
            strict_types=True,
        )
        return packed.replace(msgpack.packb(PLACEHOLDER), raw)
    except (ValueError, TypeError, OverflowError, RecursionError, msgpack.exceptions.UnpackException):
        return bytes_changed(data, draw)


def message_changed(data: bytes, draw: random.Random) -> bytes:
    """A message with something wrong in it, be it of fixed layout or msgpack."""
    fixed = data[:1] in (b"T", b"R") and draw.random() < 0.9
    return bytes_changed(data, draw) if fixed else msgpack_changed(data, draw)


def zip_changed(data: bytes, draw: random.Random) -> bytes:
    """A zip of files (arrays, say) with something wrong in one of them, or in the zip."""
    if draw.random() < 0.3:
        return bytes_changed(data, draw)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as old:
            files = [(name, old.read(name)) for name in old.namelist()]
    except Exception:  # it has been changed before
        return bytes_changed(data, draw)
    at = draw.randrange(len(files)) if files else 0
    if files:
        name, content = files[at]
        kind = draw.randrange(6)
        if kind == 0:
            del files[at]
        elif kind == 1:
            files.append((draw.choice((name, name + "x", "../x")), content))
        elif kind == 2:
            files[at] = name, draw.choice(files)[1]
        elif kind == 3 and content.startswith(b"\x93NUMPY"):
            files[at] = name, _header_changed(content, draw)
        else:
            files[at] = name, bytes_changed(content, draw)
    out = io.BytesIO()
    method = draw.choice(
        (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
    )
    with zipfile.ZipFile(out, "w", method) as new:
        for name, content in files:
            new.writestr(zipfile.ZipInfo(name), content, method)
    return out.getvalue()


def _header_changed(array: bytes, draw: random.Random) -> bytes:
    """An ``.npy`` file that says something else of itself."""
    length = int.from_bytes(array[8:10], "little")
    header, body = array[10 : 10 + length], array[10 + length :]
    new = draw.choice(HEADERS)
    key, end = new.partition(b":")[0], header.find(b"}")
    begin = header.find(key)
    if begin < 0:
        header = header[:end] + new + b", }"
    else:
        stop = header.find(b"', ", begin + len(key) + 4) if key == b"'descr'" else header.find(b", '", begin)
        header = header[:begin] + new + header[stop + (key == b"'descr'") if stop > 0 else end :]
    header = header[:60_000]
    return array[:8] + len(header).to_bytes(2, "little") + header + body
