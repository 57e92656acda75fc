"""What every function of the house keeps to."""

import ast
import itertools
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ["protocols", "agent", "world", "rsc_swarm", "tests"]
MOST_PARAMETERS = 8  # more of them want to be a named tuple
MOST_LINES = 350  # more of them have two subjects
_NAMED = re.compile(rf"(?<![\w./-])(?:{'|'.join(PACKAGES)})(?:\.\w+)+")


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


def _prose(file: Path) -> Iterator[str]:
    """The docstrings and comments of a file, line by line."""
    text = file.read_text(encoding="utf-8")
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            yield from (ast.get_docstring(node) or "").splitlines()
    yield from (line.partition("# ")[2] for line in text.splitlines() if "# " in line)


def _is_there(name: str) -> bool:
    """Whether this dotted name is a package or a module, or one has it; so is what names none, as ``world.json``."""
    parts = name.split(".")
    for length in range(len(parts), 1, -1):
        place = ROOT.joinpath(*parts[:length])
        for file in (place.with_suffix(".py"), place / "__init__.py"):
            if file.is_file():
                return {*parts[length:]} <= {*re.findall(r"\w+", file.read_text(encoding="utf-8"))}
        if place.is_dir():
            return length == len(parts)
    return True


@pytest.mark.parametrize("package", PACKAGES)
def test_what_docstrings_and_comments_name_is_there(package: str) -> None:
    """A module that is renamed is not always renamed in the words of others."""
    lost = {
        f"{file.relative_to(ROOT)}: {name}"
        for file in sorted((ROOT / package).rglob("*.py"))
        for line in _prose(file)
        for name in _NAMED.findall(line)
        if not _is_there(name)
    }
    assert lost == set()
