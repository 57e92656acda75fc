"""What decides a flight is made of arithmetic that every machine rounds alike: no function of the C library that does not.

The functions that do are those of protocols.arithmetic.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
RULES = {"kernel", "inlined_kernel", "wide_kernel", "allocating_kernel"}
# What IEEE 754 rounds in one way only, or rounds nothing; the rest of both modules is not for rules.
OF_MATH = {
    "sqrt",
    "floor",
    "ceil",
    "fabs",
    "copysign",
    "isfinite",
    "isinf",
    "isnan",
    "isqrt",
    "inf",
    "nan",
    "pi",
}
OF_NUMPY = {
    "empty", "zeros", "inf", "nan", "bool_", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64",
    "float32", "float64",
}  # fmt: skip
SUMS = {"sum", "mean", "std", "var", "prod", "dot", "cumsum"}  # in an order of NumPy's own

NOT_ALIKE = {
    "math": {
        "exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "pow", "cbrt", "hypot", "dist", "sin", "cos", "tan", "asin",
        "acos", "atan", "atan2", "sinh", "cosh", "tanh", "gamma", "erf",
    },
    "np": {
        "exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "power", "float_power", "cbrt", "hypot", "sin", "cos", "tan",
        "arcsin", "arccos", "arctan", "arctan2", "sinh", "cosh", "tanh", "dot", "matmul", "einsum", "linalg",
    },
}  # fmt: skip
# Outside of rules, what may all the same, and why that moves nobody in a simulated world.
EXCEPT = {
    "protocols/fleet/place.py": "where a room lies on the Earth",
    "protocols/fleet/plan.py": "what is refused before anybody flies",
    "protocols/keeper.py": "a real vehicle whose drone has fallen silent",
    "protocols/wire/beacon.py": "what is believed of a real vehicle",
    "protocols/wire/nature.py": "what is believed of a room's obstacles",
    "protocols/wire/planned.py": "what is drawn",
    "world/outlets/snapshot.py": "what is shown",
    "world/external.py": "a world that real vehicles fly in",
    "protocols/mission/formation.py": "lengths of two parts, summed by rows, and a root where they are rounded",
    "protocols/mission/needs.py": "a logarithm of which whole ticks are made, whatever its last digit",
}


def _parsed(*places: str) -> Iterator[tuple[str, ast.Module]]:
    for place in places:
        for file in sorted((ROOT / place).rglob("*.py")):
            yield str(file.relative_to(ROOT)), ast.parse(file.read_text(encoding="utf-8"))


def _is_rule(node: ast.AST) -> bool:
    return isinstance(node, ast.FunctionDef) and any(
        isinstance(mark, ast.Name) and mark.id in RULES for mark in node.decorator_list
    )


def _not_for_rules(rule: ast.AST) -> Iterator[str]:
    """What a rule says that machines may round differently."""
    for node in ast.walk(rule):
        match node:
            case ast.Attribute(value=ast.Name(id="math"), attr=name) if name not in OF_MATH:
                yield f"math.{name}"
            case ast.Attribute(value=ast.Name(id="np"), attr=name) if name not in OF_NUMPY:
                yield f"np.{name}"
            case ast.Call(func=ast.Attribute(attr=name)) if name in SUMS:
                yield f".{name}()"
            case ast.Call(func=ast.Name(id="sum" | "pow" as name)):
                yield f"{name}()"
            case ast.BinOp(op=ast.Pow()):
                yield "**"
            case ast.BinOp(op=ast.MatMult()):
                yield "@"


def test_no_rule_calls_what_machines_round_differently() -> None:
    rules, wrong = 0, []
    for file, tree in _parsed("protocols", "agent", "world", "rsc_swarm"):
        for rule in filter(_is_rule, ast.walk(tree)):
            rules += 1
            wrong += [f"{file}:{rule.name}: {what}" for what in _not_for_rules(rule)]  # type: ignore[attr-defined]
    assert wrong == []
    assert rules > 100  # else they are no longer found


@pytest.mark.parametrize(
    "text", ["math.exp(x)", "math.hypot(x, x)", "np.sin(x)", "x**2", "x @ x", "x.sum()", "sum(x)"]
)
def test_a_rule_that_did_would_be_found(text: str) -> None:
    (rule,) = ast.parse(f"@inlined_kernel\ndef rule(x):\n return {text}").body
    assert _is_rule(rule)
    assert len(list(_not_for_rules(rule))) == 1
    assert not list(_not_for_rules(ast.parse("math.sqrt(x) + exp(x) + np.empty(3)[0]")))


def test_names_of_math_and_numpy_are_said_in_full() -> None:
    """So that the others are found."""
    for file, tree in _parsed("protocols", "agent", "world", "rsc_swarm/batch"):
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom):
                assert node.module not in ("math", "numpy", "cmath"), file


def _not_alike(tree: ast.Module) -> list[str]:
    return [
        f"{node.value.id}.{node.attr}"
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
        if node.attr in NOT_ALIKE.get(node.value.id, ())
    ]


def test_nothing_else_that_decides_a_flight_does_either() -> None:
    """Not agent/air: real vehicles fly by the wall clock."""
    found = {
        file: names
        for file, tree in _parsed("protocols", "agent", "world", "rsc_swarm/batch")
        if not file.startswith("agent/air/") and (names := _not_alike(tree))
    }
    assert {file: names for file, names in found.items() if file not in EXCEPT} == {}
    assert EXCEPT.keys() <= found.keys()  # else strike it
