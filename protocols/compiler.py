"""The compiler: rules -> machine code. It is loaded only where something is to be compiled (protocols.kernels).

What comes out is one function of C whose only argument points to 64-bit words. It needs nothing but the C library and a processor
of this kind, so whoever runs it needs no compiler.
"""

import hashlib
from collections import namedtuple
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core import compiler, config
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, lower_getattr_generic, models, register_model
from numba.np.arrayobj import populate_array

from protocols.machine_code import MachineCode, Result, kind_of_processor, number_kind
from protocols.object_code import SYMBOL, object_code

# Arrays are borrowed from Python for as long as a kernel runs: counting references to them would cost more than the rules.
_RULE = {
    "nopython": True, "boundscheck": None, "error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True,
}  # fmt: skip
_RESULTS = {
    types.none: "none", types.boolean: "bool", types.int64: "int", types.uint64: "uint", types.float64: "float",
}  # fmt: skip
_NUMBERS = {name: kind for kind, name in _RESULTS.items()}
_IS_X86_64 = kind_of_processor().startswith("x86_64")


class _Draft(JITCodeLibrary):
    """What a rule is compiled to at first: code of the compiler's own, which is optimized as a whole with what it is called by.

    Optimizing each rule alone too, and making machine code of it that nobody calls, would take longer than all the rest.
    """

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        self._finalized = True


class _DraftCompiler(CompilerBase):
    def define_pipelines(self) -> list[Any]:
        state = self.state
        state.library = _Draft(state.targetctx.codegen(), state.func_id.func_qualname)  # type: ignore[no-untyped-call]
        state.flags.no_compile = True
        return [DefaultPassBuilder.define_nopython_pipeline(state)]

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        made: Any = super().compile_extra(func)  # type: ignore[no-untyped-call]
        made = made._replace(entry_point=object())  # callers are linked to what is registered under this name
        self.state.targetctx.insert_user_function(made.entry_point, made.fndesc, [made.library])
        return made


class _Flags(compiler.Flags):
    """How a rule is compiled. The compiler compares this a hundred thousand times, and would look at every flag each time."""

    def __hash__(self) -> int:
        return 0

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Flags) and self._values == other._values


class _Rule(CPUDispatcher):
    """A rule, for the compiler. Compiled once for all numbers: it would do it again for a call with a constant."""

    def __init__(self, *settings: Any) -> None:
        super().__init__(*settings)
        using: Any = self._compiler  # type: ignore[attr-defined]
        using._customize_flags = _Flags

    def get_call_template(self, args: Any, kws: Any) -> Any:
        plain = {name: types.unliteral(kind) for name, kind in kws.items()}
        return super().get_call_template([types.unliteral(kind) for kind in args], plain)

    def add_overload(self, made: Any) -> None:
        self.overloads[tuple(made.signature.args)] = made


@cache
def _rule_of(function: Callable[..., Any], inlined: bool, allocates: bool) -> _Rule:
    return _Rule(function, {}, {**_RULE, "_nrt": allocates, "forceinline": inlined}, _DraftCompiler)


def type_of_rule(function: Callable[..., Any], inlined: bool, allocates: bool) -> types.Type:
    """The compiler's type of a rule that other rules call."""
    return types.Dispatcher(_rule_of(function, inlined, allocates))  # which does not keep it alive


def type_of_page(group: tuple[Any, ...]) -> types.Type:
    """The compiler's type of a `protocols.kernels.by_reference` group."""
    return _Page(_type_of(group))


class _Page(types.Type):
    """A pointer to the words of a named tuple of type ``group``."""

    def __init__(self, group: Any) -> None:
        self.group = group
        digest = hashlib.blake2b(
            str(group).encode(), digest_size=8
        ).hexdigest()  # the whole name has thousands of letters
        super().__init__(f"page({group.instance_class.__name__} {digest})")


@register_model(_Page)
class _PageModel(models.OpaqueModel):
    """A pointer."""


@infer_getattr
class _Fields(AttributeTemplate):
    key = _Page

    def generic_resolve(self, kind: _Page, name: str) -> Any:  # type: ignore[override]
        parts = dict(zip(kind.group.fields, kind.group.types, strict=True))
        part = parts.get(name)
        return _Page(part) if isinstance(part, types.BaseNamedTuple) else part


@lower_getattr_generic(_Page)  # type: ignore[untyped-decorator]
def _read(context: Any, builder: Any, kind: _Page, pointer: Any, name: str) -> Any:
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
    if isinstance(part, _Page):
        return builder.inttoptr(read(0), context.get_value_type(part))
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


@global_compiler_lock  # type: ignore[untyped-decorator]
def compile_rule(rule: Any, given: tuple[Any, ...]) -> MachineCode:
    """Compile a rule (protocols.kernels) for arguments like ``given``.

    Raises:
        numba.core.errors.NumbaError: it is none that can be compiled.
    """
    leaves, call, names = _call_of(given)
    with _lightly():
        drafted = _draft(f"return rule({call})", {**names, "rule": rule}, leaves)
        entry = _entry(cpu_target.target_context, drafted.fndesc)
        made = object_code(drafted.library, entry)
        wide = object_code(drafted.library, entry, True) if rule.wide and _IS_X86_64 else b""
    return MachineCode(SYMBOL, _result_of(drafted.signature.return_type), made, wide)


@contextmanager
def _lightly() -> Iterator[None]:
    """Optimize lightly here: more takes a quarter of all compiling, and makes rules some per cent faster at most."""
    settings, usual = vars(config), vars(config)["OPT"]
    settings["OPT"] = type(usual)(1)
    try:
        yield
    finally:
        settings["OPT"] = usual  # somebody's own compiled code is none of ours


def _result_of(kind: Any) -> Result:
    """What a rule of this type returns."""
    if isinstance(kind, types.BaseTuple):
        return tuple(map(_result_of, cast(Any, kind).types))
    return _RESULTS[types.unliteral(kind)]


def _call_of(given: tuple[Any, ...]) -> tuple[list[types.Type], str, dict[str, Any]]:
    """The types of all that is given, what a rule is called with to be given the same, and the classes that this names."""
    leaves: list[types.Type] = []
    names: dict[str, Any] = {}

    def say(value: Any) -> str:
        if isinstance(value, tuple):
            parts = "".join(f"{say(part)}, " for part in value)
            if not hasattr(value, "_fields"):
                return f"({parts})"
            name = f"T{len(names)}"
            names[name] = type(value)
            return f"{name}({parts})"
        leaves.append(_type_of(value))
        return f"given.a{len(leaves) - 1}"

    call = ", ".join(map(say, given))
    return leaves, call, names


def _type_of(value: Any) -> Any:
    """The compiler's type of what is given."""
    if isinstance(value, tuple):
        names = [type(value)] if hasattr(value, "_fields") else []
        return types.BaseTuple.from_types(list(map(_type_of, value)), *names)
    if isinstance(value, np.ndarray) or hasattr(value, "_numba_type_"):
        return typeof(value)
    return _NUMBERS[number_kind(value)]


def _draft(does: str, names: dict[str, Any], leaves: list[types.Type]) -> Any:
    """What a function of one page with these leaves is compiled to, before it is machine code."""
    given = namedtuple("given", [f"a{n}" for n in range(len(leaves))])  # type: ignore[misc]
    exec(f"def entry(given):\n {does}", names)
    flags = _Flags()  # type: ignore[no-untyped-call]
    cpu_target.options.parse_as_flags(flags, {**_RULE, "_nrt": False})
    page = _Page(types.BaseTuple.from_types(leaves, given))
    return compiler.compile_extra(
        cpu_target.typing_context, cpu_target.target_context, names["entry"], (page,), None, flags, {},
        pipeline_class=_DraftCompiler,
    )  # fmt: skip


def _entry(context: Any, made: Any) -> ir.Module:
    """The function of C that calls what was compiled. It returns a number, whatever it is worth; several are left in memory."""
    module = context.create_module("entry")
    inner = ir.Function(
        module, context.call_conv.get_function_type(made.restype, made.argtypes), made.llvm_func_name
    )
    (page,) = made.argtypes
    pointer, several = context.get_value_type(page), isinstance(made.restype, types.BaseTuple)
    value = ir.VoidType() if several else context.get_data_type(made.restype)
    entry = ir.Function(module, ir.FunctionType(value, [pointer]), SYMBOL)
    builder = ir.IRBuilder(entry.append_basic_block())
    status, found = context.call_conv.call_function(builder, inner, made.restype, made.argtypes, entry.args)
    with builder.if_then(
        status.is_error, likely=False
    ):  # there is no room for an array of its own: nothing else goes wrong
        failed = ir.Function(module, ir.FunctionType(pointer, []), "PyErr_NoMemory")
        builder.call(failed, [])
    if not several:
        builder.ret(_as_data(context, builder, made.restype, found))
        return module
    word = context.get_value_type(types.uint64).as_pointer()
    last = ir.Constant(ir.IntType(64), sum(map(_size, page.group.types)))
    room = builder.load(builder.gep(builder.bitcast(entry.args[0], word.as_pointer()), [last]))
    for n, (kind, part) in enumerate(_parts(builder, made.restype, found)):
        data = _as_data(context, builder, kind, part)
        place = builder.gep(room, [ir.Constant(ir.IntType(64), n)])
        builder.store(data, builder.bitcast(place, data.type.as_pointer()))
    builder.ret_void()
    return module


def _parts(builder: Any, kind: Any, found: Any) -> Iterator[tuple[Any, Any]]:
    """Each single result and its type."""
    if isinstance(kind, types.BaseTuple):
        for index, part in enumerate(cast(Any, kind).types):
            yield from _parts(builder, part, builder.extract_value(found, index))
    else:
        yield kind, found


def _as_data(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    return context.data_model_manager[types.unliteral(kind)].as_data(builder, value)
