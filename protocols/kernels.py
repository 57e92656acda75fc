"""How a rule becomes machine code: ``@kernel`` compiles a small readable loop once and keeps it on disk (protocols.kept).

With RSC_SWARM_PYTHON_KERNELS=1 nothing is compiled: every rule runs as the Python it is written in, some hundred times
slower, for a debugger, a print or a coverage report. It gives the same bits.
"""

import ctypes
import hashlib
import mmap
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.registry import CPUDispatcher
from numba.core.typing.templates import AttributeTemplate
from numba.extending import NativeValue, infer_getattr, lower_getattr_generic, models, register_model, unbox
from numba.np.arrayobj import populate_array
from numpy.typing import NDArray

from protocols.kept import Kept, is_ours

_COMPILER = "libllvmlite"

# Arrays are borrowed from Python for as long as a kernel runs: counting references to them would cost more than the rules.
_KERNEL = {
    "nopython": True,
    "boundscheck": None,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
    "_nrt": False,
}
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


class _Rule(CPUDispatcher):
    """Compiled once for all numbers: numba would do it again for a call with a constant."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        plain = {name: types.unliteral(kind) for name, kind in kws.items()}
        return super().get_call_template([types.unliteral(kind) for kind in args], plain)


def kernel(function: F) -> F:
    """Compile ``function`` to machine code on first call; later processes load it from disk.

    Strict IEEE arithmetic (no fast-math): the same inputs give the same bits in every process of a machine, which
    is what lets a flight in 25 processes have the digest of its in-process twin. It neither makes arrays nor returns any.
    """
    return _compiled(function, _KERNEL)


def allocating_kernel(function: F) -> F:
    """A kernel that makes arrays for its own use; the parts it calls must not return any."""
    return _compiled(function, {**_KERNEL, "_nrt": True})


def _compiled(function: F, settings: dict[str, Any]) -> F:
    if not COMPILED:
        return function
    compiled: Any = _Rule(function, {}, settings)
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


class _Part(_Rule):
    """A part of kernels; Python calls it as a kernel of its own."""

    @cached_property
    def _alone(self) -> Any:
        return kernel(self.py_func)

    def add_overload(self, made: Any) -> None:
        self.overloads[tuple(made.signature.args)] = made

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return self._alone(*arguments, **named)


def inlined_kernel(function: F) -> F:
    """As `kernel`, for a part of a larger kernel: compiled into each caller."""
    if not COMPILED:
        return function
    return cast(F, _Part(function, {}, _PART, _PartCompiler))


@dataclass
class _Page:
    """A named tuple, and the 64-bit words that tell kernels what is in it; ``place`` is where they lie."""

    group: Any
    words: NDArray[np.uint64]

    def __post_init__(self) -> None:
        self.place = self.words.ctypes.data
        self._numba_type_ = _Reference(numba.typeof(self.group))


def by_reference(group: T) -> T:
    """For kernels: a named tuple of arrays, numbers and such tuples, as one pointer whose fields are read where they are used.

    Handing over a hundred arrays one by one costs more than most kernels do, and takes long to compile. Only kernels can read the
    fields of what is returned, which keeps the arrays alive.
    """
    return cast(T, _Page(group, np.array([*_words(group)], np.uint64))) if COMPILED else group


def _words(value: Any) -> Iterator[int]:
    if isinstance(value, tuple):
        for part in value:
            yield from _words(part)
    elif isinstance(value, np.ndarray):
        yield from (value.ctypes.data, *value.shape, *value.strides)
    elif isinstance(value, float):
        yield int(np.float64(value).view(np.uint64))
    else:
        yield int(value) % 2**64


class _Reference(types.Type):
    """The compiler's type of a `by_reference` group of type ``group``."""

    def __init__(self, group: Any) -> None:
        self.group = group
        digest = hashlib.blake2b(
            str(group).encode(), digest_size=8
        ).hexdigest()  # the whole name has thousands of letters
        super().__init__(f"reference({group.instance_class.__name__} {digest})")


if COMPILED:

    @register_model(_Reference)
    class _ReferenceModel(models.OpaqueModel):
        """A pointer."""

    @unbox(_Reference)  # type: ignore[untyped-decorator]
    def _unbox(kind: _Reference, page: Any, context: Any) -> NativeValue:
        place = context.pyapi.object_getattr_string(page, "place")
        pointer = context.pyapi.long_as_voidptr(place)
        context.pyapi.decref(place)
        return NativeValue(pointer)

    @infer_getattr
    class _Fields(AttributeTemplate):
        key = _Reference

        def generic_resolve(self, kind: _Reference, name: str) -> Any:  # type: ignore[override]
            parts = dict(zip(kind.group.fields, kind.group.types, strict=True))
            part = parts.get(name)
            return _Reference(part) if isinstance(part, types.BaseNamedTuple) else part

    @lower_getattr_generic(_Reference)  # type: ignore[untyped-decorator]
    def _read(context: Any, builder: Any, kind: _Reference, pointer: Any, name: str) -> Any:
        index = kind.group.fields.index(name)
        part, first = kind.group.types[index], sum(map(_size, kind.group.types[:index]))
        word = context.get_value_type(types.uint64)
        words = builder.bitcast(pointer, word.as_pointer())

        def read(place: int) -> Any:
            found = builder.load(builder.gep(words, [context.get_constant(types.intp, first + place)]))
            found.set_metadata(
                "invariant.load", builder.module.add_metadata([])
            )  # so that it need be read but once
            return found

        if isinstance(part, types.Array):
            array = context.make_array(part)(context, builder)
            populate_array(
                array,
                data=builder.inttoptr(read(0), array.data.type),
                shape=[read(1 + axis) for axis in range(part.ndim)],
                strides=[read(1 + part.ndim + axis) for axis in range(part.ndim)],
                itemsize=context.get_constant(
                    types.intp, context.get_abi_sizeof(context.get_data_type(part.dtype))
                ),
                meminfo=None,
            )
            return array._getvalue()
        if isinstance(part, types.BaseNamedTuple):
            return builder.gep(pointer, [context.get_constant(types.intp, 8 * first)])
        if isinstance(part, types.Boolean):
            return builder.icmp_unsigned("!=", read(0), word(0))
        if part == types.float64:
            return builder.bitcast(read(0), context.get_value_type(part))
        assert part in (types.int64, types.uint64), f"{name}: {part}"
        return read(0)


def _size(part: Any) -> int:
    """How many words a part of this type takes."""
    if isinstance(part, types.BaseTuple):
        return sum(map(_size, cast(Any, part).types))
    return 1 + 2 * part.ndim if isinstance(part, types.Array) else 1


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
