"""A policy's class from a file, ``path/to/homing.py:Homing``, whatever the current folder and the search path are.

Everything is read at once: the file, and, however far down, the modules beside it that an ``import`` in these texts names, be it
at the top or inside a function. What flies is compiled from what was read then, never from what Python kept of it. It is private:
a policy elsewhere with a module of the same name beside it has another one. Of two modules with one name the installed one is
taken, not the one beside the file.
"""

import ast
import builtins
import hashlib
import sys
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from protocols.foreign_file import read_file

PREFIX = "_rsc_swarm_policy_"


class _Text(NamedTuple):
    """A file as it was when it was read."""

    file: Path
    content: bytes


_Texts = Mapping[str, _Text]  # by the name that imports it; the policy's own is ""
_read: dict[str, _Texts] = {}  # by the policy's module
_newest: dict[Path, ModuleType] = {}
_held = False


def hold() -> None:
    """From now on what has been loaded already stays, whatever becomes of its files: a drone flies what its launcher read."""
    global _held
    _held = True


def load_file(path: Path) -> ModuleType:
    """The module in ``path``, run once per process and text.

    Raises:
        OSError: it cannot be read. Else whatever its text raises.
    """
    path = path.absolute()
    if _held and path in _newest:
        return _newest[path]
    texts = _read_all(path)
    digest = hashlib.blake2b(digest_size=8)
    for name, text in texts.items():
        digest.update(f"{name} {text.file} {len(text.content)}\n".encode() + text.content)
    module_name = PREFIX + digest.hexdigest()
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.append(_Finder())
    _read[module_name] = texts
    _newest[path] = import_module(module_name)
    return _newest[path]


def classes_in(module: ModuleType) -> list[str]:
    """Names of the classes that this module defines."""
    return [
        name
        for name, value in vars(module).items()
        if isinstance(value, type) and value.__module__ == module.__name__
    ]


def files_with(module: ModuleType) -> list[Path]:
    """The files that were read with this one: the policy's own, and those beside it in the order of their names."""
    return [text.file for text in _read.get(module.__name__.partition(".")[0], {}).values()]


# --- what is read --------------------------------------------------------------------------------------------


def _read_all(path: Path) -> _Texts:
    """The file and all beside it that belong to it."""
    folder, texts = path.parent, {"": _Text(path, read_file(path))}
    unseen = [""]
    while unseen:
        name = unseen.pop()
        for imported in _imported(name, texts[name]):
            for part, file in _files(folder, imported):
                if part not in texts:
                    texts[part] = _Text(file, read_file(file))
                    unseen.append(part)
    return dict(sorted(texts.items()))


def _imported(name: str, text: _Text) -> Iterator[str]:
    """The dotted names that a text imports or may import."""
    try:
        tree = ast.parse(text.content)
    except (SyntaxError, ValueError, RecursionError):  # whoever runs it will be told
        return
    package = name.split(".") if _is_package(text.file) else name.split(".")[:-1]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else []
            base = ".".join([*filter(None, above), *filter(None, [node.module])])
            yield from (f"{base}.{alias.name}".strip(".") for alias in node.names)


def _is_package(file: Path) -> bool:
    return file.name == "__init__.py"


def _files(folder: Path, dotted: str) -> Iterator[tuple[str, Path]]:
    """The modules beside the policy that importing this name runs: its packages' and its own."""
    parts = dotted.split(".")
    if _is_installed(parts[0], folder):
        return
    for length in range(1, len(parts) + 1):
        place = folder.joinpath(*parts[:length])
        for file in (place / "__init__.py", place.with_name(f"{place.name}.py")):
            if file.is_file():
                yield ".".join(parts[:length]), file
                break


def _is_installed(top: str, folder: Path) -> bool:
    """Whether Python finds this module elsewhere than in ``folder``."""
    try:
        spec = find_spec(top)
    except (ImportError, ValueError):
        return top in sys.modules
    if spec is None:
        return False
    places = [*filter(None, [spec.origin]), *(spec.submodule_search_locations or [])]
    return not any(Path(place).absolute().is_relative_to(folder) for place in places)


# --- how it is imported --------------------------------------------------------------------------------------


class _Finder(MetaPathFinder):
    """Finds the modules of policies among what was read, under ``PREFIX...`` for a policy and ``PREFIX....name`` beside it."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        policy, _, name = fullname.partition(".")
        texts = _read.get(policy, {})
        parent = any(other.startswith(f"{name}.") for other in texts)
        if name in texts:
            file = texts[name].file
            loader = _Loader(texts[name], _builtins_for(policy, texts))
            spec = spec_from_file_location(fullname, file, loader=loader)
            assert spec is not None
            if parent or not name or _is_package(file):
                spec.submodule_search_locations = []  # nothing is looked for on the disk any more
            return spec
        if parent:  # a folder of modules without an __init__.py
            return ModuleSpec(fullname, None, is_package=True)
        return None


class _Loader(Loader):
    """Runs a text with these built-in functions."""

    def __init__(self, text: _Text, functions: dict[str, Any]) -> None:
        self._text, self._functions = text, functions

    def exec_module(self, module: ModuleType) -> None:
        vars(module)["__builtins__"] = self._functions
        exec(compile(self._text.content, self._text.file, "exec", dont_inherit=True), vars(module))


def _builtins_for(policy: str, texts: _Texts) -> dict[str, Any]:
    """What is built in, but ``import`` looks among the policy's own modules first, whenever it is asked."""
    own = {name.partition(".")[0] for name in texts if name}

    def import_(
        name: str, globals: Any = None, locals: Any = None, fromlist: Any = (), level: int = 0
    ) -> Any:
        top = name.partition(".")[0]
        if level or top not in own:
            return builtins.__import__(name, globals, locals, fromlist, level)
        whole = import_module(f"{policy}.{name}")
        if fromlist:
            return builtins.__import__(whole.__name__, globals, locals, fromlist)
        return sys.modules[f"{policy}.{top}"]

    return {**vars(builtins), "__import__": import_}
