"""The floors of the house: who may import whom (pyproject.toml says it), and what must never be loaded on a drone."""

import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import grimp
import pytest
from importlinter.cli import lint_imports

ROOT = Path(__file__).resolve().parents[2]


def test_nobody_imports_what_the_floors_forbid(capsys: pytest.CaptureFixture[str]) -> None:
    broken = lint_imports(config_filename=str(ROOT / "pyproject.toml"), cache_dir=None)
    assert broken == 0, capsys.readouterr().out


def test_no_files_import_each_other_in_a_circle() -> None:
    """Nor for their types alone."""
    graph = grimp.build_graph("protocols", "agent", "world", "rsc_swarm", cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    assert len(imports) > 100
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as circle:
        pytest.fail(" -> ".join(circle.args[1]))


@pytest.mark.parametrize("module", ["agent.process", "agent.core", "world.server.session"])
def test_no_learning_framework_and_no_command_line_is_loaded_in_flight(module: str) -> None:
    loaded = subprocess.run(
        [sys.executable, "-c", f"import sys, {module}; print(*sys.modules)"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    ).stdout.split()
    assert module in loaded
    heavy = {"torch", "matplotlib", "typer", "rich", "rsc_swarm"}  # not scipy: Numba loads it wherever it is
    other_side = {"agent": "world", "world": "agent"}[module.partition(".")[0]]
    assert (heavy | {other_side}) & set(loaded) == set()
