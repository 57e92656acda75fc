"""Somebody's files with names of ours, of a library's or of Python's own are named in one line."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("name", ["agent", "world", "protocols"])
def test_a_foreign_module_of_our_packages_names_is_named(name, tmp_path):
    (tmp_path / f"{name}.py").write_text("")
    environment = {**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"}
    line = f"import {name} finds {tmp_path}/{name}.py instead of {ROOT}/{name}: rename it, or start from another folder"
    command = [sys.executable, "-m", "rsc_swarm", "--version"]
    said = subprocess.run(command, env=environment, capture_output=True, text=True, cwd="/")
    assert (said.returncode, said.stdout, said.stderr.count("\n")) == (2, "", 1)
    assert said.stderr.startswith(f"rsc-swarm: {line}")
    said = subprocess.run(
        [sys.executable, "-c", "import rsc_swarm as rs; rs.simulate"],
        env=environment, capture_output=True, text=True, cwd="/",
    )  # fmt: skip
    assert said.stderr.splitlines()[-1].startswith(f"ImportError: {line}")


def test_where_the_command_starts_a_foreign_module_is_named_too(tmp_path):
    (tmp_path / "agent").mkdir()
    (tmp_path / "agent" / "__init__.py").write_text("")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "rsc_swarm", "simulate"]
    said = subprocess.run(command, env=environment, capture_output=True, text=True, cwd=tmp_path)
    assert said.returncode == 2
    assert said.stderr.startswith(
        f"rsc-swarm: import agent finds {tmp_path}/agent/__init__.py instead of {ROOT}/agent"
    )


@pytest.mark.parametrize("name", ["yaml", "numpy", "secrets"])
def test_a_foreign_module_of_a_librarys_name_is_named(name, tmp_path):
    (tmp_path / f"{name}.py").write_text("")
    environment = {**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"}
    command = [sys.executable, "-m", "rsc_swarm", "mission", "--set", "fly_s=1"]
    said = subprocess.run(command, env=environment, capture_output=True, text=True, cwd="/")
    assert said.returncode == 2
    assert said.stderr.startswith(
        f"rsc-swarm: import {name} finds {tmp_path}/{name}.py instead of the library {name}"
    )
