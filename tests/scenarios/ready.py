"""How soon a drone's process, started by itself with a vehicle that is up, is ready for preflight.

python -m tests.scenarios.ready

Seconds from the start of ``rsc-swarm fly`` until it says that it is, as on a companion computer: interpreter, kernels and all;
and the memory that it has then. Of ten starts of each kind.
"""

import os
import signal
import statistics
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import psutil

from tests.scenarios.fleets import RUN, Fleet
from tests.scenarios.vehicles import KINDS

_STARTS, _PATIENCE_S = 10, 60.0


@contextmanager
def saying(words: str, log: Path, *command: str) -> Iterator[tuple[float, int]]:
    """A program, once it has said this in ``log``; how long that took [s], and its number. It is asked to leave at the end."""
    begun = time.monotonic()
    with log.open("wb") as file, subprocess.Popen([*RUN, *command], stderr=file) as program:
        try:
            while words not in log.read_text():
                if program.poll() is not None or time.monotonic() - begun > _PATIENCE_S:
                    raise TimeoutError(f"{command[0]} does not say {words!r}: {log.read_text()}")
                time.sleep(0.005)
            yield time.monotonic() - begun, program.pid
        finally:
            program.send_signal(signal.SIGTERM)


def starts(fleet: Fleet) -> tuple[list[float], float]:
    """Seconds that each took; resident MB of the largest."""
    taken, largest = [], 0.0
    for _ in range(_STARTS):
        fly = "fly", "--agent", "0", "--fleet", str(fleet.file)
        with saying("ready after", fleet.folder / "fly.log", *fly) as (seconds, number):
            taken.append(seconds)
            time.sleep(1.0)
            largest = max(largest, psutil.Process(number).memory_info().rss / 1e6)
    return taken, largest


@contextmanager
def up(kind: str, folder: Path) -> Iterator[Fleet]:
    """A fleet whose vehicles are up, and their radio host with them."""
    with ExitStack() as stack:
        changes: dict[str, Any] = (
            {"drones": stack.enter_context(KINDS[kind]()).drones} if kind in KINDS else {}
        )
        fleet = Fleet(folder, **changes)
        if kind == "crazyflie":
            radio = "radio", "--fleet", str(fleet.file), "--dongle", "0"
            stack.enter_context(saying("ready", folder / "radio.log", *radio))
        yield fleet


def main() -> None:
    for kind in ("point", *KINDS):
        with tempfile.TemporaryDirectory() as folder, up(kind, Path(folder)) as fleet:
            taken, largest = starts(fleet)
        load = os.getloadavg()[0]
        print(
            f"{kind:10s} {statistics.median(taken):.2f} s, at most {max(taken):.2f} s, {largest:.0f} MB (load {load:.0f})",
            flush=True,
        )


if __name__ == "__main__":
    main()
