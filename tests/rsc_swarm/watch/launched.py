"""What a live page comes to in a launch, on a quiet machine, each in one line:

python -m tests.rsc_swarm.watch.launched moving [--runs 5]      # seconds from the command to a moving picture, in Chromium
python -m tests.rsc_swarm.watch.launched factor [--pairs 5]     # what a page with a reader costs of the launch's speed
"""

import argparse
import json
import statistics
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from tests.rsc_swarm.watch.browsers import Page, browser, command


def moving(drones: int, runs: int) -> str:
    """From the command to the second picture on the page; the browser is there before."""
    took = []
    with browser() as chromium:
        for _ in range(runs):
            began = time.monotonic()
            with command("launch", "--agents", str(drones), "--set", "fly_s=600", "--view") as (_, address):
                page = Page(chromium, address)
                page.until("page.recording.pictures.length > 1 && page.recording.end > 0")
                took.append(time.monotonic() - began)
                page.page.close()
    return f"{drones} drones: a moving picture {_told(took)} s after the command ({runs} runs)"


def factor(drones: int, pairs: int) -> str:
    """With and without, in turns; the reader is this process."""
    shares = []
    with TemporaryDirectory() as folder:
        for pair in range(pairs):
            order = (False, True) if pair % 2 else (True, False)
            speeds = {seen: _speed(drones, seen, Path(folder) / f"{pair}-{seen}.json") for seen in order}
            shares.append(100 * (1 - speeds[True] / speeds[False]))
    return f"{drones} drones: a page costs {_told(shares)} % of the speed of a launch ({pairs} pairs)"


def _speed(drones: int, seen: bool, report: Path) -> float:
    words = ["launch", "--agents", str(drones), "--map", "3", "--json", str(report)]
    if seen:
        with command(*words, "--view") as (flight, address):
            place, _ = address.removeprefix("http://").split("/#")
            reader = threading.Thread(target=_read, args=(f"ws://{place}/live",))
            reader.start()
            flight.wait()
            reader.join()
    else:
        subprocess.run([sys.executable, "-m", "rsc_swarm", *words], capture_output=True, check=False)
    return float(json.loads(report.read_bytes())["real_time_factor"])


def _read(address: str) -> None:
    with suppress(ConnectionClosed), connect(address, max_size=None) as page:
        while True:
            page.recv()


def _told(figures: list[float]) -> str:
    return f"{statistics.median(figures):.2f} ({min(figures):.2f} to {max(figures):.2f})"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=("moving", "factor"))
    parser.add_argument("--drones", type=int, default=25)
    parser.add_argument("--runs", "--pairs", type=int, default=5)
    asked = parser.parse_args()
    print(
        moving(asked.drones, asked.runs) if asked.what == "moving" else factor(asked.drones, asked.runs),
        flush=True,
    )


if __name__ == "__main__":
    main()
