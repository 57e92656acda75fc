"""From what the compiler drafted to an object file that needs nothing but the C library (protocols.compiler)."""

from functools import cache
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen

from protocols.machine_code import WIDE

SYMBOL = "rule"

# What compiled code calls for an array of its own, and when it has done with it. The compiler's own would need the compiler.
_ALLOCATOR = """
declare noalias ptr @malloc(i64)
declare void @free(ptr)

define noalias ptr @NRT_MemInfo_alloc_aligned(i64 %size, i32 %align) {
  %wide = zext i32 %align to i64
  %head = add i64 %wide, 48
  %all = add i64 %size, %head
  %info = call noalias ptr @malloc(i64 %all)
  %failed = icmp eq ptr %info, null
  br i1 %failed, label %done, label %fill
fill:
  %begin = ptrtoint ptr %info to i64
  %end = add i64 %begin, %head
  %mask = sub i64 0, %wide
  %place = and i64 %end, %mask
  %data = inttoptr i64 %place to ptr
  store i64 1, ptr %info
  %data_at = getelementptr i8, ptr %info, i64 24
  store ptr %data, ptr %data_at
  %size_at = getelementptr i8, ptr %info, i64 32
  store i64 %size, ptr %size_at
  br label %done
done:
  ret ptr %info
}

define void @NRT_MemInfo_call_dtor(ptr %info) {
  call void @free(ptr %info)
  ret void
}
"""


class _AnyProcessor(JITCPUCodegen):
    """Makes code for every processor of this machine's kind."""

    features: tuple[str, ...] = ()

    def _get_host_cpu_name(self) -> str:
        return "generic"

    def _get_host_cpu_features(self) -> str:
        return ",".join(f"+{feature}" for feature in self.features)


class _WideProcessor(_AnyProcessor):
    """Makes code for those that have `WIDE`."""

    features = WIDE


@cache
def _maker(wide: bool) -> _AnyProcessor:
    return (_WideProcessor if wide else _AnyProcessor)("rules")  # type: ignore[no-untyped-call]


class _Whole(JITCodeLibrary):
    """Everything that a rule needs, as the text of an object file."""

    object: bytes

    def _optimize_final_module(self) -> None:
        for part in (*self._final_module.functions, *self._final_module.global_variables):
            if not part.is_declaration and part.name != SYMBOL:
                part.linkage = "internal"  # nobody else can call it: what is not needed goes
        super()._optimize_final_module()  # type: ignore[no-untyped-call]

    def _finalize_final_module(self) -> None:
        self.object = self._codegen._tm.emit_object(self._final_module)
        self._finalized = True


def object_code(drafted: Any, entry: ir.Module, wide: bool = False) -> bytes:
    """The object file of what the compiler has drafted, and of the function `SYMBOL` in ``entry``, by which it is called."""
    whole = _Whole(_maker(wide), SYMBOL)  # type: ignore[no-untyped-call]
    whole.add_linking_library(drafted)  # type: ignore[no-untyped-call]
    whole.add_ir_module(entry)  # type: ignore[no-untyped-call]
    whole.add_llvm_module(llvm.parse_assembly(_ALLOCATOR))  # type: ignore[no-untyped-call]
    whole.finalize()  # type: ignore[no-untyped-call]
    return whole.object
