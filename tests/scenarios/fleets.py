"""A fleet on the air in real processes: drones, and an operator who does what is asked."""

import itertools
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

EXAMPLES = Path(__file__).parents[2] / "examples"
RUN = [sys.executable, "-m", "rsc_swarm"]
_IMPATIENT = """
from rsc_swarm.air import station
from rsc_swarm.cli.main import main
station._STEPS["preflight"] = station._STEPS["preflight"]._replace(within_s={})
main()
"""
# A machine that runs tests is busy: who is not led for two seconds, or sees others late, has not failed.
_PATIENT = {"setpoint_land_s": 5, "clock_hold_ms": 150, "clock_land_ms": 2000}
_ports = itertools.count(10000 + os.getpid() % 1000 * 20, 20)  # twenty for each fleet of a test run


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
        run = [*RUN, "keys", str(self.folder / "keys"), "--fleet", str(self.file)]
        subprocess.run(run, check=True, capture_output=True, timeout=60)

    @contextmanager
    def in_the_air(self, *words: str) -> Iterator[subprocess.Popen[bytes]]:
        """All drones in their processes, children of the one that is yielded."""
        command = [*RUN, "air", "--fleet", str(self.file), "--run-dir", str(self.folder), *words]
        with (self.folder / "air.log").open("wb") as log, subprocess.Popen(command, stderr=log) as air:
            try:
                yield air
            finally:
                air.terminate()
                air.wait(60)

    def operator(self, steps: str, preflight_s: float | None = None) -> subprocess.Popen[bytes]:
        """An operator at work; one may wait for preflight no longer than so many seconds."""
        flights = str(self.folder / "ground")
        run = [sys.executable, "-c", _IMPATIENT.format(preflight_s)] if preflight_s else RUN
        command = [*run, "ground", "--fleet", str(self.file), "--do", steps, "--run-dir", flights]
        with (self.folder / "ground.log").open("wb") as log:
            return subprocess.Popen(command, stdout=log, stderr=log)

    def await_said(self, words: str, times: int, seconds: float) -> None:
        """Wait until the drones, or who started them, have said this so often."""
        deadline = time.monotonic() + seconds
        while self.log.count(words) < times:
            assert time.monotonic() < deadline, f"{words!r} not said {times} times:\n{self.told}{self.log}"
            time.sleep(0.05)

    @property
    def told(self) -> str:
        """What the operator said so far."""
        return (self.folder / "ground.log").read_text()

    @property
    def log(self) -> str:
        """What the drones said so far."""
        return (self.folder / "air.log").read_text()


def drone_processes(air: subprocess.Popen[bytes]) -> dict[int, int]:
    """The process of each drone, in the order of their start."""
    children = Path(f"/proc/{air.pid}/task/{air.pid}/children").read_text().split()
    return dict(enumerate(map(int, children)))
