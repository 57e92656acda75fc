"""How a rule becomes machine code: ``@kernel`` compiles a small readable loop once and keeps it on disk.

What is kept is named after all that decides it: the text of every project file that the kernel's module imports, however far
down, and the versions it was compiled with. So an edit anywhere that could matter compiles again, a process never flies a rule
other than the one in its sources, and two checkouts of the same text share what either compiled. Kernels of files outside
the project are compiled anew in every process: what they depend on is not known here.

Importing touches no folder. Compiled code is unpickled, so a folder is taken only if it is ours and only we may write to it.

With RSC_SWARM_PYTHON_KERNELS=1 nothing is compiled: every rule runs as the Python it is written in, some hundred times
slower, for a debugger, a print or a coverage report. It gives the same bits.
"""

import ctypes
import hashlib
import mmap
import os
import pickle
import re
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast, dataclass_transform

import llvmlite
import numba
import numpy as np
from numba import types
from numba.core import caching, cgutils
from numba.core.serialize import dumps
from numba.experimental import structref
from numba.extending import intrinsic

from protocols.whole_file import WriteError, write_whole

_ROOT = Path(__file__).resolve().parents[1]
_PACKAGES = "protocols|agent|world|rsc_swarm"
_IMPORT = re.compile(
    rf"^[ \t]*(?:from|import)[ \t]+((?:{_PACKAGES})(?:\.\w+)*)\b(?:[ \t]+import[ \t]+(\([^)]*\)|[^\n#]+))?",
    re.MULTILINE,
)
_COMPILER = "libllvmlite"
_DIGEST_BYTES = 8
_KEPT_S = 14 * 86400.0  # a process may still be using what another version compiled

F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")

COMPILED = os.environ.get("RSC_SWARM_PYTHON_KERNELS", "0") in ("", "0")
if not COMPILED:
    np.seterr(all="ignore")  # as compiled: integers wrap around, and 1 / 0 is infinite, without a word


def _files_of(module: str) -> Iterator[Path]:
    """The project files that importing ``module`` runs: its packages' and its own."""
    parts = module.split(".")
    for length in range(1, len(parts) + 1):
        place = _ROOT.joinpath(*parts[:length])
        yield from (file for file in (place / "__init__.py", place.with_suffix(".py")) if file.is_file())


@cache
def _imports(file: Path) -> frozenset[Path]:
    found: set[Path] = set()
    for module, names in _IMPORT.findall(file.read_text(encoding="utf-8")):
        found.update(_files_of(module))
        for name in re.findall(r"\w+", names):
            found.update(_files_of(f"{module}.{name}"))
    return frozenset(found)


@cache
def sources_of(file: Path) -> tuple[Path, ...]:
    """All project files whose text decides what a kernel in ``file`` does: its own, its packages', and what these import,
    however far down."""
    open_ = list(_files_of(".".join(file.relative_to(_ROOT).with_suffix("").parts)))
    known = set(open_)
    while open_:
        for path in _imports(open_.pop()) - known:
            known.add(path)
            open_.append(path)
    return tuple(sorted(known))


@cache
def fingerprint(file: Path) -> str:
    """16 hexadecimal digits that change with all that decides what a kernel in ``file`` is compiled to."""
    versions = (sys.version, numba.__version__, llvmlite.__version__, np.__version__)
    digest = hashlib.blake2b(repr(versions).encode(), digest_size=_DIGEST_BYTES)
    for path in sources_of(file):
        text = path.read_bytes()
        digest.update(f"{path.relative_to(_ROOT)} {len(text)}\n".encode() + text)
    return digest.hexdigest()


def _bases() -> Iterator[Path]:
    places = [Path(os.environ.get("XDG_CACHE_HOME", ""))]
    with suppress(RuntimeError):  # no home
        places.append(Path.home() / ".cache")
    yield from (place / "rsc-swarm" for place in places if place.is_absolute())
    with suppress(OSError):  # no room for temporary files
        yield Path(tempfile.gettempdir()) / f"rsc-swarm-cache-{os.getuid()}"


def _is_ours(folder: Path) -> bool:
    """Whether nobody else could have put something into ``folder``: a folder, no link, ours, and only we may write to it."""
    status = folder.lstat()
    only_we = not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and only_we


@cache
def cache_folder() -> Path | None:
    """Where compiled kernels are kept; None where no folder can be written to and trusted. Made at the first call."""
    for base in _bases():
        try:
            base.mkdir(parents=True, exist_ok=True, mode=0o700)
            if _is_ours(base) and os.access(base, os.R_OK | os.W_OK | os.X_OK):
                return base
        except OSError:
            continue
    return None


def _digest(data: bytes) -> bytes:
    return hashlib.blake2b(data, digest_size=_DIGEST_BYTES).digest()


class _Place(caching._CacheLocator):
    """Names what is kept; numba looks at the file's time and path instead."""

    def __init__(self, function: Callable[..., Any], file: Path) -> None:
        self._file, self._line = file, function.__code__.co_firstlineno
        self._py_file = str(file)  # for numba's warnings

    def get_cache_path(self) -> str:
        return ""  # not known before it is needed: `_Kept`

    def ensure_cache_path(self) -> None:
        pass  # `_Kept` has made it

    def get_source_stamp(self) -> str:
        return fingerprint(self._file)

    def get_disambiguator(self) -> str:
        return f"{self._file.relative_to(_ROOT).parent}".replace("/", ".") + f"-{self._line}"

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> "_Place":
        return cls(function, _file_of(function))


class _Form(caching.CompileResultCacheImpl):
    _locator_classes = [_Place]  # noqa: RUF012


class _Files:
    """One file for each compiled form of one kernel, named after what it was compiled for.

    numba's own index of all forms can be left pointing at another form when two processes write to it at once. A file that is
    damaged counts as missing.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self.folder = Path()

    def load(self, key: object) -> Any:
        try:
            kept = self._path(key).read_bytes()
        except OSError:
            return None
        digest, data = kept[:_DIGEST_BYTES], kept[_DIGEST_BYTES:]
        return pickle.loads(data) if digest == _digest(data) else None

    def save(self, key: object, compiled: object) -> None:
        data, path = dumps(compiled), self._path(key)
        write_whole(path, _digest(data) + data)

    def _path(self, key: object) -> Path:
        return self.folder / f"{self._name}.{_digest(repr(key).encode()).hex()}.nbc"


class _Kept(caching.Cache):
    """The compiled forms of one kernel, in a folder that is looked for only when there is something to load or keep."""

    _impl_class = _Form  # type: ignore[assignment]

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        self._stamp = fingerprint(_file_of(function))
        self._files = _Files(self._impl.filename_base)
        self._cache_file = self._files  # type: ignore[assignment]

    def load_overload(self, signature: Any, target: Any) -> Any:
        return super().load_overload(signature, target) if self.find_folder() else None  # type: ignore[no-untyped-call]

    def save_overload(self, signature: Any, data: Any) -> None:
        folder = self.find_folder()
        if folder is None:
            return
        with suppress(OSError, WriteError):  # no room, say: then it is compiled again next time
            if not folder.exists():
                folder.mkdir(exist_ok=True, mode=0o700)
                _sweep(folder)
            super().save_overload(signature, data)  # type: ignore[no-untyped-call]

    def find_folder(self) -> Path | None:
        """Where the forms are or will be kept; None if nowhere that can be trusted."""
        base = cache_folder()
        if base is None:
            return None
        folder = self._files.folder = base / f"kernels-{self._stamp}"
        try:
            return folder if _is_ours(folder) else None
        except FileNotFoundError:
            return folder
        except OSError:
            return None


def _sweep(newest: Path) -> None:
    """Remove what no version has compiled for long before ``newest`` was made."""
    for path in newest.parent.glob("kernels-*"):
        if newest.stat().st_mtime - path.stat().st_mtime > _KEPT_S:
            shutil.rmtree(path, ignore_errors=True)


def is_kept(rule: Callable[..., Any]) -> bool:
    """Whether some compiled form of this kernel, as its sources are now, lies on disk; also where nothing is compiled."""
    if not COMPILED:
        return True
    kept = getattr(rule, "_cache", None)
    folder = kept.find_folder() if isinstance(kept, _Kept) else None
    return folder is not None and folder.exists()


def _file_of(function: Callable[..., Any]) -> Path:
    return Path(function.__code__.co_filename).resolve()


def _kept(dispatcher: Any, function: Callable[..., Any]) -> Any:
    if _file_of(function).is_relative_to(_ROOT):
        dispatcher._cache = _Kept(function)
    return dispatcher


def kernel(function: F) -> F:
    """Compile ``function`` to machine code on first call; later processes load it from disk.

    Strict IEEE arithmetic (no fast-math): the same inputs give the same bits in every process of a machine, which
    is what lets a flight in 25 processes have the digest of its in-process twin.
    """
    return cast(F, _kept(numba.njit(error_model="numpy")(function), function)) if COMPILED else function


def inlined_kernel(function: F) -> F:
    """As `kernel`, for a part of a larger kernel: compiled into each caller.

    Handing arrays to a kernel that is not inlined counts references to each of them, which for a small rule costs more
    than the rule. Not for kernels that allocate.
    """
    if not COMPILED:
        return function
    return cast(F, _kept(numba.njit(error_model="numpy", forceinline=True)(function), function))


@dataclass_transform()
def by_reference(fields: type[T]) -> type[T]:
    """A class of named fields that kernels take as one pointer: handing them a hundred arrays one by one costs more than they do.

    Made by a kernel; only kernels read its fields.
    """
    if not COMPILED:
        return dataclass(fields)
    name, module = fields.__name__, fields.__module__
    kind = structref.register(type(f"{name}Type", (types.StructRef,), {"__module__": module}))
    setattr(sys.modules[module], kind.__name__, kind)  # what is kept on disk refers to it
    made = type(name, (structref.StructRefProxy,), {"__module__": module, "__doc__": fields.__doc__})
    structref.define_proxy(made, kind, list(fields.__annotations__))
    return made


def release_compiler() -> None:
    """Give back the memory of the compiler's code, for when the kernels needed are loaded.

    The code is a file's, so the system reads it again should it be called once more. Does nothing where there is no Linux.
    """
    maps = Path("/proc/self/maps")
    for line in maps.read_text().splitlines() if maps.exists() else []:
        span, access, *_, name = line.split()
        if access == "r-xp" and _COMPILER in name:
            begin, end = (int(bound, 16) for bound in span.split("-"))
            ctypes.CDLL(None).madvise(
                ctypes.c_void_p(begin), ctypes.c_size_t(end - begin), mmap.MADV_DONTNEED
            )


def _lent(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """``value`` of the compiler's type ``kind``, with the references of the arrays in it left uncounted."""
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        array.parent = cgutils.get_null_value(array.parent.type)
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        parts: Any = enumerate(cast(Any, kind).types)
        members = [_lent(context, builder, part, builder.extract_value(value, at)) for at, part in parts]
        return context.make_tuple(builder, kind, members)
    return value


def borrowed(group: T) -> T:
    """For use in kernels: a named tuple of arrays, numbers and such tuples, the same ones, whose references nobody counts.

    Counting them at every use costs more than most rules do. The caller keeps the arrays alive.
    """
    return group


if COMPILED:

    def _borrow(typing: Any, group: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return _lent(context, builder, group, arguments[0])

        return group(group), generate

    borrowed = intrinsic(_borrow)  # type: ignore[assignment]
