"""A policy's class from a file, ``path/to/homing.py:Homing``, whatever the current folder and the search path are.

The file is compiled from the text that is read, never from what Python kept of it, so what flies is what stands there. Its
module is private. Modules that lie beside the file can be imported at its top, unless one that is installed has the name; they
belong to it, and a policy elsewhere with a module of the same name beside it gets its own.
"""

import hashlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

_PREFIX = "_rsc_swarm_policy_"
_beside: dict[
    str, dict[Path, bytes]
] = {}  # by policy module: what it imported from beside it, as it was then
_borrowed: set[str] = set()  # names of the modules beside the policy loaded last


def load_file(path: Path) -> ModuleType:
    """The module in ``path``, run once per process and text.

    Raises:
        OSError: it cannot be read. Else whatever its text raises.
    """
    path = path.absolute()
    text = path.read_bytes()
    name = _PREFIX + hashlib.blake2b(f"{path}\n".encode() + text, digest_size=8).hexdigest()
    if name in sys.modules and all(_still(file, was) for file, was in _beside[name].items()):
        return sys.modules[name]
    for other in _borrowed:
        sys.modules.pop(other, None)
    _borrowed.clear()
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    code = compile(text, str(path), "exec", dont_inherit=True)
    sys.modules[name] = module
    before, quiet = set(sys.modules), sys.dont_write_bytecode
    found = list(sys.path)
    sys.path.append(str(path.parent))
    sys.dont_write_bytecode = True
    try:
        exec(code, module.__dict__)
    except BaseException:
        del sys.modules[name]
        raise
    finally:
        sys.dont_write_bytecode = quiet
        sys.path[:] = found
        beside = _files_in(path.parent)
        _borrowed.update(beside.keys() - before)
    _beside[name] = {file: file.read_bytes() for file in sorted(beside.values())}
    return module


def _still(file: Path, text: bytes) -> bool:
    return file.is_file() and file.read_bytes() == text


def _files_in(folder: Path) -> dict[str, Path]:
    """The modules imported from this folder, policies aside."""
    files = {name: Path(str(getattr(module, "__file__", None))) for name, module in list(sys.modules.items())}
    return {
        name: file
        for name, file in files.items()
        if file.parent == folder
        and file.suffix == ".py"
        and name != "__main__"
        and not name.startswith(_PREFIX)
    }


def classes_in(module: ModuleType) -> list[str]:
    """Names of the classes that this module defines."""
    return [
        name
        for name, value in vars(module).items()
        if isinstance(value, type) and value.__module__ == module.__name__
    ]


def files_beside(module: ModuleType) -> list[Path]:
    """The files beside a policy's own from which it imported, in the order of their names."""
    return list(_beside.get(module.__name__, {}))
