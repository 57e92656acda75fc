"""How a rule becomes machine code: ``@kernel`` compiles a small readable loop once and keeps it on disk (protocols.kept).

With RSC_SWARM_PYTHON_KERNELS=1 nothing is compiled: every rule runs as the Python it is written in, some hundred times
slower, for a debugger, a print or a coverage report. It gives the same bits.
"""

import ctypes
import mmap
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar, cast, dataclass_transform

import numpy as np
from numba import types
from numba.core import cgutils
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.registry import CPUDispatcher
from numba.experimental import structref
from numba.extending import intrinsic

from protocols.kept import Kept, is_ours

_COMPILER = "libllvmlite"

_KERNEL = {"nopython": True, "boundscheck": None, "error_model": "numpy", "no_cfunc_wrapper": True}
_PART = {**_KERNEL, "forceinline": True, "no_cpython_wrapper": True}

F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")

COMPILED = os.environ.get("RSC_SWARM_PYTHON_KERNELS", "0") in ("", "0")
if not COMPILED:
    np.seterr(all="ignore")  # as compiled: integers wrap around, and 1 / 0 is infinite, without a word


def is_kept(rule: Callable[..., Any]) -> bool:
    """Whether some compiled form of this kernel, as its sources are now, lies on disk; also where nothing is compiled."""
    if not COMPILED:
        return True
    kept = getattr(rule, "_cache", None)
    folder = kept.find_folder() if isinstance(kept, Kept) else None
    return folder is not None and folder.exists()


def kernel(function: F) -> F:
    """Compile ``function`` to machine code on first call; later processes load it from disk.

    Strict IEEE arithmetic (no fast-math): the same inputs give the same bits in every process of a machine, which
    is what lets a flight in 25 processes have the digest of its in-process twin.
    """
    if not COMPILED:
        return function
    compiled: Any = CPUDispatcher(function, {}, _KERNEL)
    if is_ours(function):
        compiled._cache = Kept(function)
    return cast(F, compiled)


class _PartCode(JITCodeLibrary):
    """What a part is compiled to: code of the compiler's own that only goes into kernels, which are then optimized as a whole.

    Optimizing each part too, and making machine code of it that nobody calls, would take longer than all the rest.
    """

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        self._finalized = True


class _PartCompiler(CompilerBase):
    def define_pipelines(self) -> list[Any]:
        state = self.state
        state.library = _PartCode(state.targetctx.codegen(), state.func_id.func_qualname)  # type: ignore[no-untyped-call]
        state.flags.no_compile = True
        return [DefaultPassBuilder.define_nopython_pipeline(state)]

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        made: Any = super().compile_extra(func)  # type: ignore[no-untyped-call]
        made = made._replace(entry_point=object())  # callers are linked to what is registered under this name
        self.state.targetctx.insert_user_function(made.entry_point, made.fndesc, [made.library])
        return made


class _Part(CPUDispatcher):
    """A part of kernels; Python calls it as a kernel of its own."""

    @cached_property
    def _alone(self) -> Any:
        return kernel(self.py_func)

    def add_overload(self, made: Any) -> None:
        self.overloads[tuple(made.signature.args)] = made

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return self._alone(*arguments, **named)


def inlined_kernel(function: F) -> F:
    """As `kernel`, for a part of a larger kernel: compiled into each caller.

    Handing arrays to a kernel that is not inlined counts references to each of them, which for a small rule costs more
    than the rule. Not for kernels that allocate.
    """
    if not COMPILED:
        return function
    return cast(F, _Part(function, {}, _PART, _PartCompiler))


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
