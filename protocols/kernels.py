"""How a rule becomes machine code: ``@kernel`` compiles a small readable loop once and keeps it on disk (protocols.kept).

Afterwards it is only linked (protocols.machine_code); the compiler (protocols.compiler) is loaded where there is something to
compile, and nowhere else: it would be the largest part of a drone.

With RSC_SWARM_PYTHON_KERNELS=1 nothing is compiled: every rule runs as the Python it is written in, some hundred times
slower, for a debugger, a print or a coverage report. It gives the same bits.
"""

import ctypes
import inspect
import mmap
import os
import re
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cached_property, partial
from operator import is_
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from protocols.kept import Kept, is_ours
from protocols.machine_code import MachineCode, Result, linked, number_kind

# In /proc/self/smaps: where what is only read of a file lies, of which this process has changed nothing.
_UNCHANGED = re.compile(r"^(\w+)-(\w+) r-[x-]p .* /.*\n(?:\w+: .*\n)*?Anonymous: +0 kB$", re.MULTILINE)
_FORMATS = {"bool": "?7x", "int": "q", "uint": "Q", "float": "d"}  # of 64 bits each, as `struct` has them
_LAYOUT = (
    0x0001 | 0x0002 | 0x0100 | 0x0400
)  # of numpy's flags: contiguous in either order, aligned, writeable

F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")

COMPILED = os.environ.get("RSC_SWARM_PYTHON_KERNELS", "0") in ("", "0")
if not COMPILED:
    np.seterr(all="ignore")  # as compiled: integers wrap around, and 1 / 0 is infinite, without a word

_watching: list[Callable[["Kernel"], None]] = []
_others_may_run = False


@contextmanager
def compiling_watched(compiled: Callable[["Kernel"], None]) -> Iterator[None]:
    """Call ``compiled`` whenever a kernel has been compiled."""
    _watching.append(compiled)
    try:
        yield
    finally:
        _watching.remove(compiled)


@contextmanager
def others_may_run() -> Iterator[None]:
    """Kernels that are called meanwhile let other threads of this process run. For who has rules work on several things side by
    side, and nobody else look at them."""
    global _others_may_run
    _others_may_run = True
    try:
        yield
    finally:
        _others_may_run = False


def kernel(function: F) -> F:
    """Compile ``function`` to machine code on first call; later processes load it from disk.

    Strict IEEE arithmetic (no fast-math): the same inputs give the same bits in every process of a machine, which
    is what lets a flight in 25 processes have the digest of its in-process twin. It neither makes arrays nor returns any: it
    returns nothing, a number, or several.
    """
    return cast(F, Kernel(function)) if COMPILED else function


def wide_kernel(function: F) -> F:
    """As `kernel`, for one that does the same to long rows of numbers: there is a form of it for processors that can do more of
    them at once. It gives the same bits."""
    return cast(F, Kernel(function, wide=True)) if COMPILED else function


def allocating_kernel(function: F) -> F:
    """A kernel that makes arrays for its own use; the parts it calls must not return any."""
    return cast(F, Kernel(function, allocates=True)) if COMPILED else function


def inlined_kernel(function: F) -> F:
    """As `kernel`, for a part of a larger kernel: compiled into each caller."""
    return cast(F, Kernel(function, inlined=True)) if COMPILED else function


class Kernel:
    """A rule that is machine code when it is called: one form of it for each kind of arguments it is called with.

    Arguments are numbers, arrays, tuples of them, and what `by_reference` makes; they are borrowed from Python for as long as it
    runs.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        inlined: bool = False,
        allocates: bool = False,
        wide: bool = False,
    ) -> None:
        self.py_func, self.inlined, self.allocates, self.wide = function, inlined, allocates, wide
        self.__name__, self.__doc__, self.__module__ = (
            function.__name__,
            function.__doc__,
            function.__module__,
        )
        self.__qualname__, self.__wrapped__ = function.__qualname__, function
        self._forms: dict[tuple[Any, ...], _Form] = {}

    @property
    def is_ours(self) -> bool:
        """Whether the project's sources decide what it does; else it is compiled anew in every process."""
        return is_ours(self.py_func)

    @cached_property
    def kept(self) -> Kept:
        """Where its forms are kept."""
        return Kept(self.py_func)

    @property
    def _numba_type_(self) -> Any:
        """For the compiler, where another rule calls this one."""
        from protocols.compiler import type_of_rule

        return type_of_rule(self.py_func, self.inlined, self.allocates)

    def __call__(self, *given: Any, **named: Any) -> Any:
        if named:
            given = inspect.signature(self.py_func).bind(*given, **named).args
        return self._form_for(given).bound(given)()

    def bound(self, given: tuple[Any, ...]) -> Callable[[], Any]:
        """As the function `bound`."""
        call = self._form_for(given).bound(given)
        vars(call)["given"] = given  # live as long
        return call

    def _form_for(self, given: tuple[Any, ...]) -> "_Form":
        kind = tuple([_kind_of(value) for value in given])
        form = self._forms.get(kind)
        if form is None:
            form = self._forms[kind] = self._find(given)
        return form

    def _find(self, given: tuple[Any, ...]) -> "_Form":
        """Its form for such arguments: what is kept, or else compiled now."""
        name = ",".join(map(_name_of, given))
        code = self.kept.load(name) if self.is_ours else None
        if code is None:
            from protocols.compiler import compile_rule

            code = compile_rule(self, given)
            if self.is_ours:
                self.kept.save(name, code)
            for tell in _watching:
                tell(self)
        return _Form(code, given)


def bound(rule: Callable[..., T], *given: Any) -> Callable[[], T]:
    """A call of this kernel with these arguments, for one that is asked again and again: what they are like is looked at once.
    Numbers stay what they are; arrays are read anew each time."""
    return rule.bound(given) if isinstance(rule, Kernel) else partial(rule, *given)


def rebound(rule: Callable[..., T]) -> Callable[..., T]:
    """The same rule, for one that is mostly asked with the very same arguments: what they are like is looked at only where others
    come."""
    last: tuple[Any, ...] = ()
    call: Callable[[], T] | None = None

    def ask(*given: Any) -> T:
        nonlocal last, call
        if call is None or not all(map(is_, given, last)):
            last, call = given, bound(rule, *given)
        return call()

    return ask


def is_kept(rule: Callable[..., Any]) -> bool:
    """Whether some compiled form of this kernel, as its sources are now, lies on disk; also where nothing is compiled."""
    if not isinstance(rule, Kernel):
        return True
    return rule.kept.is_any()


class _Form:
    """Runs this code with arguments like ``given``."""

    def __init__(self, code: MachineCode, given: tuple[Any, ...]) -> None:
        self._linked, self._result = linked(code), code.result
        kinds = [] if isinstance(code.result, str) else [_FORMATS[kind] for kind in _flat(code.result)]
        self._pack = struct.Struct("".join(map(_format_of, given)) + ("Q" if kinds else "")).pack
        self._read = struct.Struct("".join(kinds)).unpack
        self._room = ctypes.c_char * (8 * len(kinds))

    def bound(self, given: tuple[Any, ...]) -> Callable[[], Any]:
        """A call with these arguments, for as long as they live."""
        function = self._linked.beside_others if _others_may_run else self._linked.alone
        if isinstance(self._result, str):
            return partial(function, self._pack(*_words(given)))
        found = self._room()
        words = self._pack(*_words(given), ctypes.addressof(found))

        def call() -> Any:
            function(words)
            return _shaped(self._result, iter(self._read(found)))

        return call


def _flat(result: Result) -> Iterator[str]:
    for part in (result,) if isinstance(result, str) else result:
        yield from (part,) if isinstance(part, str) else _flat(part)


def _shaped(result: Result, found: Iterator[Any]) -> Any:
    """What was found, in tuples as the rule returns it."""
    return next(found) if isinstance(result, str) else tuple(_shaped(part, found) for part in result)


# --- what arguments are like -----------------------------------------------------------------------------------


def _kind_of(value: Any) -> Any:
    """What tells apart the forms of a kernel, quickly."""
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, value.flags.num & _LAYOUT
    if isinstance(value, Page):
        return value.kind
    if isinstance(value, tuple):
        return type(value), *[_kind_of(part) for part in value]
    return number_kind(value)


def _name_of(value: Any) -> str:
    """The same in words that are equal in all processes."""
    if isinstance(value, np.ndarray):
        flags, kind = value.flags, value.dtype.descr if value.dtype.names else value.dtype.str
        order = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
        return f"{kind}[{value.ndim}{order}{'' if flags.writeable else 'r'}{'' if flags.aligned else 'u'}]"
    if isinstance(value, Page):
        return f"*{value.kind}"
    if isinstance(value, tuple):
        names = getattr(value, "_fields", range(len(value)))
        parts = ",".join(f"{name}:{_name_of(part)}" for name, part in zip(names, value, strict=True))
        return f"{type(value).__name__}({parts})"
    return number_kind(value)


def _format_of(value: Any) -> str:
    """How `struct` writes it in 64-bit words."""
    if isinstance(value, np.ndarray):
        return "Q" + "q" * (2 * value.ndim)
    if isinstance(value, Page):
        return "Q"
    if isinstance(value, tuple):
        return "".join(map(_format_of, value))
    return _FORMATS[number_kind(value)]


def _words(given: tuple[Any, ...]) -> list[Any]:
    """All that is given, as numbers of 64 bits."""
    words: list[Any] = []
    for value in given:
        if isinstance(value, Page):
            words.append(value.place)
        elif isinstance(value, np.ndarray):
            words += (value.ctypes.data, *value.shape, *value.strides)
        elif isinstance(value, tuple):
            words += _words(value)
        else:
            words.append(value)
    return words


class Page:
    """A named tuple, and the 64-bit words that tell kernels what is in it. kind: as those of arguments, in words. place: where
    the words lie."""

    def __init__(self, group: Any) -> None:
        self.group, self.kind = group, _name_of(group)
        self._words = np.frombuffer(struct.pack(_format_of(group), *_words(group)), np.uint64)
        self.place = self._words.ctypes.data

    @property
    def _numba_type_(self) -> Any:
        """For the compiler."""
        from protocols.compiler import type_of_page

        return type_of_page(self.group)


def by_reference(group: T) -> T:
    """For kernels: a named tuple of arrays, numbers and such tuples, as one pointer whose fields are read where they are used.

    Handing over a hundred arrays one by one costs more than most kernels do, and takes long to compile. Only kernels can read the
    fields of what is returned, which keeps the arrays alive.
    """
    return cast(T, Page(group)) if COMPILED else group


def release_memory() -> None:
    """Give back memory that only starting took, when all is loaded: what was freed, and code, above all that of what compiles.

    Code that is given back is as it is in its file, and the system reads it again where it is used once more. Does nothing where
    there is no Linux.
    """
    library = ctypes.CDLL(None)
    with suppress(AttributeError):  # glibc's own
        library.malloc_trim(0)
    told, advise = Path("/proc/self/smaps"), library.madvise
    for begin, end in _UNCHANGED.findall(told.read_text()) if told.exists() else []:
        at, behind = int(begin, 16), int(end, 16)
        advise(ctypes.c_void_p(at), ctypes.c_size_t(behind - at), mmap.MADV_DONTNEED)
