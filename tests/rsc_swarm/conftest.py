"""The command in this process; and launchers that tests tell a story to (tests.rsc_swarm.stories), in a folder of their own."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from rsc_swarm.cli import main as cli
from tests.rsc_swarm.stories import launcher


@pytest.fixture
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("run")


@pytest.fixture
def tell(here: Path) -> Callable[[str], list[str]]:
    """Run a story to its end; returns the lines it printed."""

    def run(story: str) -> list[str]:
        process = launcher(story, here)
        out, err = process.communicate(timeout=120.0)
        assert process.returncode == 0, err
        return out.splitlines()

    return run


@pytest.fixture
def begin(here: Path) -> Iterator[Callable[[str], "subprocess.Popen[str]"]]:
    """Start a story that the test is going to cut short, and wait until it prints its first line."""
    begun: list[subprocess.Popen[str]] = []

    def start(story: str) -> "subprocess.Popen[str]":
        process = launcher(story, here)
        begun.append(process)
        assert process.stdout is not None
        assert process.stdout.readline().strip() == "ready", process.communicate()
        return process

    yield start
    for process in begun:
        process.kill()
        process.communicate()


@pytest.fixture
def run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., tuple[int, str, str]]:
    """Run the command in this process; returns exit code, stdout and stderr."""

    def run_it(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["rsc-swarm", *arguments])
        with pytest.raises(SystemExit) as left:
            cli.main()
        said = capsys.readouterr()
        return int(left.value.code or 0), said.out, said.err

    return run_it
