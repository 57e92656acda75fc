"""A policy's class from a file, ``path/to/homing.py:Homing``, whatever the current folder and the search path are.

The file is compiled from the text that is read, never from what Python kept of it, so what flies is what stands there. Its
module is private. What lies beside the file can be imported from it, after everything that is installed.
"""

import hashlib
import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

_PREFIX = "_rsc_swarm_policy_"


def load_file(path: Path) -> ModuleType:
    """The module in ``path``, run once per process and text.

    Raises:
        OSError: it cannot be read. Else whatever its text raises.
    """
    path = path.absolute()
    text = path.read_bytes()
    name = _PREFIX + hashlib.blake2b(f"{path}\n".encode() + text, digest_size=8).hexdigest()
    if name in sys.modules:
        return sys.modules[name]
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    code = compile(text, str(path), "exec", dont_inherit=True)
    sys.modules[name] = module
    try:
        exec(code, module.__dict__)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def classes_in(module: ModuleType) -> list[str]:
    """Names of the classes that this module defines."""
    return [
        name
        for name, value in vars(module).items()
        if isinstance(value, type) and value.__module__ == module.__name__
    ]


def files_beside(module: ModuleType) -> Iterator[Path]:
    """The files of the modules that lie beside a policy's file and have been imported, in the order of their names."""
    if not module.__name__.startswith(_PREFIX):
        return
    folder = Path(str(module.__file__)).parent
    known = {file for other in list(sys.modules.values()) if (file := getattr(other, "__file__", None))}
    for file in sorted(known - {module.__file__}):
        if Path(file).parent == folder and file.endswith(".py"):
            yield Path(file)
