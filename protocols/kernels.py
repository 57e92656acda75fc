"""How a rule becomes machine code: ``@kernel`` compiles a small readable loop once and keeps it on disk.

Numba's own cache looks only at the file that holds a kernel, so a caller would keep using an old version of a
rule that lives in another file. Here the cache folder is named after the text of *all* files that hold kernels: any
edit gets a fresh folder, and a process never runs a stale rule.
"""

import ctypes
import hashlib
import mmap
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import cgutils, config
from numba.extending import intrinsic

_PACKAGES = ("protocols", "agent", "world", "rsc_swarm")
_COMPILER = "libllvmlite"
_KEPT_S = 14 * 86400.0  # a process may still be using what another version compiled

F = TypeVar("F", bound=Callable[..., Any])


def _sources_fingerprint(root: Path) -> str:
    digest = hashlib.blake2b(numba.__version__.encode(), digest_size=8)
    for package in _PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            source = path.read_bytes()
            if b"kernel\ndef " in source:
                digest.update(source)
    return digest.hexdigest()


def _choose_cache() -> Path:
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "rsc-swarm"
    try:
        base.mkdir(parents=True, exist_ok=True)
        if not os.access(base, os.W_OK):
            raise PermissionError(base)
    except OSError:
        base = Path(tempfile.gettempdir()) / f"rsc-swarm-cache-{os.getuid()}"
        base.mkdir(parents=True, exist_ok=True)
    chosen = base / f"kernels-{_sources_fingerprint(Path(__file__).resolve().parent.parent)}"
    if not chosen.exists():
        chosen.mkdir(exist_ok=True)
        for path in base.glob("kernels-*"):
            if chosen.stat().st_mtime - path.stat().st_mtime > _KEPT_S:
                shutil.rmtree(path, ignore_errors=True)
    return chosen


CACHE_DIR = _choose_cache()
config.CACHE_DIR = str(CACHE_DIR)  # type: ignore[attr-defined]


def kernel(function: F) -> F:
    """Compile ``function`` to machine code on first call; later processes load it from disk.

    Strict IEEE arithmetic (no fast-math): the same inputs give the same bits in every process of a machine, which
    is what lets a flight in 25 processes have the digest of its in-process twin.
    """
    return cast(F, numba.njit(cache=True, error_model="numpy")(function))


def inlined_kernel(function: F) -> F:
    """As `kernel`, for a part of a larger kernel: compiled into each caller.

    Handing arrays to a kernel that is not inlined counts references to each of them, which for a small rule costs more
    than the rule. Not for kernels that allocate.
    """
    return cast(F, numba.njit(cache=True, error_model="numpy", forceinline=True)(function))


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


_intrinsic: Any = intrinsic  # numba's annotations know nothing of what it makes of a function


@_intrinsic  # type: ignore[untyped-decorator]
def borrowed(typing: Any, group: Any) -> Any:
    """For use in kernels: a named tuple of arrays, the same ones, whose references nobody counts.

    Counting them at every use costs more than most rules do. The caller keeps the arrays alive.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        lent = []
        for index, kind in enumerate(group.types):
            array = context.make_array(kind)(context, builder, builder.extract_value(arguments[0], index))
            array.meminfo = cgutils.get_null_value(array.meminfo.type)
            array.parent = cgutils.get_null_value(array.parent.type)
            lent.append(array._getvalue())
        return context.make_tuple(builder, group, lent)

    return group(group), generate
