"""A fleet on the air in real processes: drones, and an operator who does what is asked."""

import itertools
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

EXAMPLES = Path(__file__).parents[2] / "examples"
_RUN = [sys.executable, "-m", "rsc_swarm"]
_ports = itertools.count(20000 + os.getpid() % 2000 * 20, 20)  # twenty for each fleet of a test run


class Fleet:
    """The fleet of an example file, with ``changes``, on ports of its own; logs and flights in ``folder``."""

    def __init__(self, folder: Path, example: str = "room.yaml", **changes: Any) -> None:
        self.folder, self.file = folder, folder / "fleet.yaml"
        fields = (
            yaml.safe_load((EXAMPLES / example).read_text()) | {"radio": {"port": next(_ports)}} | changes
        )
        self.port: int = fields["radio"]["port"]
        self.file.write_text(yaml.safe_dump(fields))

    def make_keys(self) -> None:
        """The fleet file names their folder."""
        run = [*_RUN, "keys", str(self.folder / "keys"), "--fleet", str(self.file)]
        subprocess.run(run, check=True, capture_output=True, timeout=60)

    @contextmanager
    def in_the_air(self, *words: str) -> Iterator[subprocess.Popen[bytes]]:
        """All drones in their processes, children of the one that is yielded."""
        command = [*_RUN, "air", "--fleet", str(self.file), "--run-dir", str(self.folder), *words]
        with (self.folder / "air.log").open("wb") as log, subprocess.Popen(command, stderr=log) as air:
            try:
                yield air
            finally:
                air.terminate()
                air.wait(60)

    def operator(self, steps: str) -> subprocess.Popen[str]:
        """An operator at work."""
        command = [
            *_RUN,
            "ground",
            "--fleet",
            str(self.file),
            "--do",
            steps,
            "--run-dir",
            str(self.folder / "ground"),
        ]
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    @property
    def log(self) -> str:
        """What the drones said so far."""
        return (self.folder / "air.log").read_text()


def drone_processes(air: subprocess.Popen[bytes]) -> dict[int, int]:
    """The process of each drone, in the order of their start."""
    children = Path(f"/proc/{air.pid}/task/{air.pid}/children").read_text().split()
    return dict(enumerate(map(int, children)))
