"""What every function of the house keeps to."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
MOST_PARAMETERS = 8  # more of them want to be a named tuple


@pytest.mark.parametrize("package", ["protocols", "agent", "world", "rsc_swarm", "tests"])
def test_no_function_takes_more_than_eight_parameters(package: str) -> None:
    many = {}
    for file in sorted((ROOT / package).rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
                taken = [
                    entry.arg for entry in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
                ]
                count = len(taken) - (taken[:1] in (["self"], ["cls"]))
                if count > MOST_PARAMETERS:
                    many[f"{file.relative_to(ROOT)}:{node.lineno}"] = count
    assert many == {}
