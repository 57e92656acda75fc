"""Machine code that runs without the compiler that made it: linked into this process, and called with one pointer."""

import ctypes
from collections.abc import Callable
from functools import cache
from itertools import count
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import numpy as np

_NUMBERS = {
    bool: "bool",
    np.bool_: "bool",
    np.int64: "int",
    np.uint64: "uint",
    float: "float",
    np.float64: "float",
}
_C_TYPES = {
    "none": None, "bool": ctypes.c_bool, "int": ctypes.c_int64, "uint": ctypes.c_uint64, "float": ctypes.c_double,
}  # fmt: skip
# What most processors of x86-64 have since 2013: eight numbers at once. No fused multiplication and addition, which rounds once
# where the others round twice: so both forms of a rule give the same bits.
WIDE = ("avx", "avx2")
_numbers = count()
_libraries: list[Any] = []  # code is gone when its library is


Result = str | tuple["Result", ...]


class MachineCode(NamedTuple):
    """A compiled rule: an object file, the function in it, and what that returns: none, bool, int, uint or float. Of a tuple of
    them each is left in 8 bytes, one after the other; the last word that is given points to the first.

    wide: another object file of the same rule, for processors that have `WIDE`; empty where there is none.
    """

    symbol: str
    result: Result
    object: bytes
    wide: bytes = b""


def number_kind(value: object) -> str:
    """As what a number goes to machine code, in 64 bits: bool, int, uint or float.

    Raises:
        TypeError: it is none, or needs more.
    """
    if kind := _NUMBERS.get(type(value)):
        return kind
    if isinstance(value, int | np.integer) and -(2**63) <= value < 2**64:
        return "int" if value < 2**63 else "uint"
    if isinstance(value, float | np.float32 | np.float16):
        return "float"
    raise TypeError(
        f"a kernel takes arrays, numbers of 64 bits and tuples of them, not {type(value).__name__}: {value!r}"
    )


@cache
def _linker() -> Any:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.create_lljit_compiler()


@cache
def kind_of_processor() -> str:
    """What code is made for: every processor of this machine's kind, x86-64 say. Code for this one alone would be no faster, but
    for long rows of the same operation (`WIDE`)."""
    return str(llvm.get_default_triple())


@cache
def is_wide() -> bool:
    """Whether this processor has `WIDE`."""
    return all(llvm.get_host_cpu_features().get(feature, False) for feature in WIDE)


class Linked(NamedTuple):
    """A rule in this process, to be called with its words. alone: no other thread of Python's runs meanwhile, which costs least.
    beside_others: they may."""

    alone: Callable[[bytes], Any]
    beside_others: Callable[[bytes], Any]


def linked(code: MachineCode) -> Linked:
    """Make it ready to run.

    Raises:
        RuntimeError: it needs something that is not in this process.
    """
    image = code.wide if code.wide and is_wide() else code.object
    builder = llvm.JITLibraryBuilder().add_object_img(image).add_current_process()
    library = builder.export_symbol(code.symbol).link(_linker(), f"rule-{next(_numbers)}")
    _libraries.append(library)
    result = _C_TYPES[code.result] if isinstance(code.result, str) else None
    alone, beside_others = (
        kind(result, ctypes.c_char_p)(library[code.symbol]) for kind in (ctypes.PYFUNCTYPE, ctypes.CFUNCTYPE)
    )
    return Linked(alone, beside_others)
