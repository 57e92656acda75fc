"""Reading and writing YAML as people mean it: one place for mission files, training configs and ``--set``.

What is read is YAML 1.2's core: text, numbers, true, false, null, lists and mappings with names for keys. The surprises of
YAML 1.1 stay what they look like: ``yes``, ``on``, ``off``, ``12:34``, ``1_000`` and dates are text. What could be meant in two
ways or does harm is refused with its line: a key written twice, a number with a leading zero, a number too large, tags,
aliases, deep nesting, a file of several documents.
"""

import math
import re
from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml

from protocols.errors import SwarmError
from protocols.foreign_file import read_file

MAX_BYTES = 1 << 16
MAX_DEPTH = 16
_MAX_DIGITS = 40

_NULL = re.compile(r"(?:~|null|Null|NULL|)$")
_BOOL = re.compile(r"(?:true|True|TRUE|false|False|FALSE)$")
_INT = re.compile(r"[-+]?[0-9]+$")
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?$")
_NOT_FINITE = re.compile(r"(?:[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))$")
_PLAIN = {
    "tag:yaml.org,2002:null": (_NULL, ["~", "n", "N", ""]),
    "tag:yaml.org,2002:bool": (_BOOL, list("tTfF")),
    "tag:yaml.org,2002:int": (_INT, list("-+0123456789")),
    "tag:yaml.org,2002:float": (
        re.compile(f"(?:{_FLOAT.pattern}|{_NOT_FINITE.pattern})"),
        list("-+.0123456789"),
    ),
}


class ReadingError(SwarmError, ValueError):
    """A text that is not read; one line says where and why."""


class _Loader(yaml.SafeLoader):
    yaml_implicit_resolvers = {}  # noqa: RUF012  PyYAML's own table has this type

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event: yaml.Event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            raise _refusal(event, "anchors and aliases are not read; write the value out")
        if isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent) and event.tag is not None:
            raise _refusal(event, f"the tag {event.tag} is not read; leave it out")
        if isinstance(event, yaml.CollectionStartEvent) and self._depth >= MAX_DEPTH:
            raise _refusal(event, f"nested deeper than {MAX_DEPTH} levels")
        self._depth += 1
        try:
            return super().compose_node(parent, index)
        finally:
            self._depth -= 1

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        lines: dict[str, int] = {}
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode) or key.tag != "tag:yaml.org,2002:str":
                text = repr(key.value) if isinstance(key, yaml.ScalarNode) else "a list or mapping"
                raise _refusal(key, f"{text} is no name of a field; if it is meant as one, put it in quotes")
            line = key.start_mark.line + 1
            if key.value in lines:
                raise _refusal(
                    key, f"{key.value!r} is written twice, before in line {lines[key.value]}; keep one"
                )
            lines[key.value] = line
        return super().construct_mapping(node, deep)

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        _check_digits(node)
        return int(node.value)

    def construct_yaml_float(self, node: yaml.ScalarNode) -> float:
        if _NOT_FINITE.match(node.value):
            return float(node.value.replace(".", "", 1))
        _check_digits(node)
        value = float(node.value)
        if math.isinf(value):
            raise _refusal(node, f"{node.value}: is too large for a number")
        return value


class _Dumper(yaml.SafeDumper):
    """Quotes whatever this reader, or one of YAML 1.1, would not read back as text."""


for _tag, (_pattern, _first) in _PLAIN.items():
    _Loader.add_implicit_resolver(_tag, _pattern, _first)
    _Dumper.add_implicit_resolver(_tag, _pattern, _first)
_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_yaml_int)
_Loader.add_constructor("tag:yaml.org,2002:float", _Loader.construct_yaml_float)


def _check_digits(node: yaml.ScalarNode) -> None:
    digits = node.value.lstrip("+-")
    if len(digits) > _MAX_DIGITS:
        raise _refusal(node, f"a number of {len(digits)} digits is too long")
    if re.match("0[0-9]", digits):
        raise _refusal(
            node, f"{node.value}: a number with a leading zero; leave it out, or write quotes for text"
        )


def _refusal(at: yaml.Node | yaml.Event, why: str) -> yaml.MarkedYAMLError:
    mark: Any = at.start_mark  # the stubs give events and nodes marks of several types
    return yaml.MarkedYAMLError(problem=why, problem_mark=mark)


def read_yaml(text: str) -> Any:
    """The plain value that ``text`` says.

    Raises:
        ReadingError: one line with the place in the text and what would be right.
    """
    if len(text) > MAX_BYTES:
        raise ReadingError(f"is longer than {MAX_BYTES >> 10} KiB")
    try:
        loader = _Loader(text)
    except yaml.reader.ReaderError as error:
        raise ReadingError(f"is not text: character {error.position} is #x{error.character:04x}") from None
    try:
        return loader.get_single_data()
    except yaml.MarkedYAMLError as error:
        why = error.problem or error.context or "cannot be read"
        if "'\\t'" in why:
            why += "; indent with spaces"
        mark = error.problem_mark or error.context_mark
        place = f" at line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise ReadingError(f"is not valid YAML{place} ({why})") from None
    except (
        ValueError,
        OverflowError,
    ):  # PyYAML does not check the code of an escape, nor the number of a version
        mark = loader.get_mark()
        raise ReadingError(
            f"is not valid YAML at line {mark.line + 1}, column {mark.column + 1} (there is no such character or number)"
        ) from None


def read_yaml_file(path: Path) -> dict[str, Any]:
    """The fields written in a YAML file; an empty file has none.

    Raises:
        ReadingError: the file is missing, unreadable, too long, or no mapping of fields.
    """
    try:
        text = read_file(path, MAX_BYTES).decode("utf-8")
    except OSError as error:
        raise ReadingError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise ReadingError(f"{path}: is not UTF-8 text; give YAML") from None
    try:
        fields = read_yaml(text)
    except ReadingError as error:
        raise ReadingError(f"{path}: {error}") from None
    if fields is None:
        return {}
    if not isinstance(fields, dict):
        raise ReadingError(
            f"{path}: must be a mapping of fields such as 'agents: 25', not a {type(fields).__name__}"
        )
    return fields


def write_yaml(fields: dict[str, Any]) -> str:
    """YAML from which `read_yaml` reads equal fields."""
    written: str = yaml.dump(fields, Dumper=_Dumper, sort_keys=False, width=110, default_flow_style=None)
    return written


def write_value(value: Any) -> str:
    """The same on one line, for ``--set``."""
    written: str = yaml.dump(value, Dumper=_Dumper, width=float("inf"), default_flow_style=True)
    return written.removesuffix("\n").removesuffix("...").strip()
