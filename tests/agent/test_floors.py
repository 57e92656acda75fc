"""The floors of the house: who may import whom, and what must never be loaded on a drone."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROJECT = {"protocols", "agent", "world", "rsc_swarm"}
MAY_IMPORT = {
    "protocols": {"protocols"},
    "agent": {"agent", "protocols"},
    "world": {"world", "protocols"},
}
PURE = {
    "zenoh",
    "socket",
    "threading",
    "asyncio",
    "time",
    "subprocess",
    "multiprocessing",
    "psutil",
    "random",
}


def imports(path: Path) -> set[str]:
    """The top packages that a file imports anywhere in it, also inside functions."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative imports hide the floor"
            found.add((node.module or "").partition(".")[0])
    return found


def files(package: str) -> list[Path]:
    found = sorted((ROOT / package).rglob("*.py"))
    assert found
    return found


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_a_floor_rests_only_on_those_below(package: str) -> None:
    wrong = {
        str(path.relative_to(ROOT)): sorted(above)
        for path in files(package)
        if (above := imports(path) & PROJECT - MAY_IMPORT[package])
    }
    assert wrong == {}


def test_the_protocols_know_no_clock_no_network_and_no_processes() -> None:
    wrong = {path.name: sorted(found) for path in files("protocols") if (found := imports(path) & PURE)}
    assert wrong == {}


def test_the_cores_know_no_clock_and_no_network() -> None:
    cores = [
        ROOT / "agent" / name
        for name in ("core.py", "tick.py", "perceive.py", "observation.py", "slot_endpoints.py")
    ]
    cores += [
        ROOT / "world" / name
        for name in ("core.py", "plant.py", "medium/medium.py", "referee.py", "field.py", "invariants.py")
    ]
    assert {path.name: imports(path) & PURE for path in cores if imports(path) & PURE} == {}


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
