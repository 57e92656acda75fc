"""What every function of the house keeps to."""

import ast
import itertools
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ["protocols", "agent", "world", "rsc_swarm", "tests"]
MOST_PARAMETERS = 8  # more of them want to be a named tuple
MOST_LINES = 350  # more of them have two subjects


def test_no_file_is_longer_than_one_subject() -> None:
    files = itertools.chain.from_iterable((ROOT / package).rglob("*.py") for package in PACKAGES)
    lines = {str(file.relative_to(ROOT)): file.read_text(encoding="utf-8").count("\n") for file in files}
    assert {file: count for file, count in lines.items() if count > MOST_LINES} == {}


@pytest.mark.parametrize("package", PACKAGES)
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
