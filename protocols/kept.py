"""Where machine code is kept, and what it is named after.

What is kept is named after all that decides it: the text of every project file that the kernel's module imports, however far
down, and the versions it was compiled with. So an edit anywhere that could matter compiles again, a process never flies a rule
other than the one in its sources, and two checkouts of the same text share what either compiled. Kernels of files outside
the project are compiled anew in every process: what they depend on is not known here.

An installation may bring along what was compiled when it was made (`ship`). It is as much to be trusted as the sources beside it,
and named after them alone: whatever made it, it does what they say.

Importing touches no folder. Compiled code is run, so a folder is taken only if it is ours and only we may write to it.
"""

import hashlib
import os
import re
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgpack

from protocols.machine_code import MachineCode, kind_of_processor
from protocols.whole_file import WriteError, write_whole

_ROOT = Path(__file__).resolve().parents[1]
_PACKAGES = "protocols|agent|world|rsc_swarm"
_IMPORT = re.compile(
    rf"^[ \t]*(?:from|import)[ \t]+((?:{_PACKAGES})(?:\.\w+)*)\b(?:[ \t]+import[ \t]+(\([^)]*\)|[^\n#]+))?",
    re.MULTILINE,
)
_SHIPPED = Path(__file__).with_name("compiled")
_DIGEST_BYTES = 8
_KEPT_S = 14 * 86400.0  # a process may still be using what another version compiled


@cache
def _files_of(module: str) -> tuple[Path, ...]:
    """The project files that importing ``module`` runs: its packages' and its own."""
    package, _, _ = module.rpartition(".")
    place = _ROOT.joinpath(*module.split("."))
    own = (place / "__init__.py", place.with_suffix(".py"))
    return (*(_files_of(package) if package else ()), *(file for file in own if file.is_file()))


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
def _fingerprint_of_text(file: Path) -> str:
    """16 hexadecimal digits that change with the text of all sources of a kernel in ``file``, wherever they lie."""
    digest = hashlib.blake2b(digest_size=_DIGEST_BYTES)
    for path in sources_of(file):
        digest.update(_text(path))
    return digest.hexdigest()


@cache
def _text(file: Path) -> bytes:
    text = file.read_bytes()
    return f"{file.relative_to(_ROOT)} {len(text)}\n".encode() + text


@cache
def _versions() -> tuple[str, ...]:
    return (sys.version, *map(version, ("numba", "llvmlite", "numpy")))


@cache
def fingerprint(file: Path) -> str:
    """16 hexadecimal digits that change with all that decides what a kernel in ``file`` is compiled to."""
    return _digest(f"{_versions()} {_fingerprint_of_text(file)}".encode()).hex()


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


_shipping = False


def ship() -> Path:
    """From now on this process keeps what it compiles in the installation itself, for all who use it: where.

    Raises:
        OSError: there it may not write.
    """
    global _shipping
    shutil.rmtree(_SHIPPED, ignore_errors=True)  # of other sources, perhaps
    _SHIPPED.mkdir()
    _shipping = True
    return _SHIPPED


class Kept:
    """The compiled forms of one kernel, in a folder that is looked for only when there is something to load or keep.

    One file for each form, named after what it was compiled for. A file that is damaged counts as missing.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        file = _file_of(function)
        self._stamp, self._shipped = fingerprint(file), _SHIPPED / _fingerprint_of_text(file)
        place = str(file.relative_to(_ROOT).with_suffix("")).replace("/", ".")
        self._name = f"{place}.{function.__name__}-{function.__code__.co_firstlineno}"

    def load(self, form: str) -> MachineCode | None:
        """What is kept for arguments of this form."""
        folder = self.find_folder()
        return (_read(self._path(folder, form)) if folder else None) or _read(self._path(self._shipped, form))

    def save(self, form: str, code: MachineCode) -> None:
        """Keep it, if there is room: else it is compiled again next time.

        Raises:
            OSError, protocols.whole_file.WriteError: there is none for what is to be shipped.
        """
        folder = self.find_folder()
        if folder is None:
            return
        try:
            if not folder.exists():
                folder.mkdir(exist_ok=True, mode=0o755 if _shipping else 0o700)
                _sweep(folder)
            data = msgpack.packb(code)
            write_whole(self._path(folder, form), _digest(data) + data)
        except (OSError, WriteError):
            if _shipping:
                raise

    def is_any(self) -> bool:
        """Whether any form is kept."""
        folders = (self.find_folder(), self._shipped)
        return any(folder is not None and any(folder.glob(f"{self._name}.*")) for folder in folders)

    def _path(self, folder: Path, form: str) -> Path:
        return folder / f"{self._name}.{_digest(f'{kind_of_processor()} {form}'.encode()).hex()}.o"

    def find_folder(self) -> Path | None:
        """Where the forms are or will be kept; None if nowhere that can be trusted."""
        if _shipping:
            return self._shipped
        base = cache_folder()
        if base is None:
            return None
        folder = base / f"kernels-{self._stamp}"
        try:
            return folder if _is_ours(folder) else None
        except FileNotFoundError:
            return folder
        except OSError:
            return None


def _read(path: Path) -> MachineCode | None:
    try:
        kept = path.read_bytes()
    except OSError:
        return None
    digest, data = kept[:_DIGEST_BYTES], kept[_DIGEST_BYTES:]
    return MachineCode(*msgpack.unpackb(data, use_list=False)) if digest == _digest(data) else None


def _sweep(newest: Path) -> None:
    """Remove what no version has compiled for long before ``newest`` was made."""
    for path in newest.parent.glob("kernels-*"):
        if newest.stat().st_mtime - path.stat().st_mtime > _KEPT_S:
            shutil.rmtree(path, ignore_errors=True)


def _file_of(function: Callable[..., Any]) -> Path:
    return Path(function.__code__.co_filename).resolve()


def is_ours(function: Callable[..., Any]) -> bool:
    """Whether ``function`` is the project's: what those of other files depend on is not known here."""
    return _file_of(function).is_relative_to(_ROOT)
