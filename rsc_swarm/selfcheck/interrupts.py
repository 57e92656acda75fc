"""One Ctrl-C at a random moment of a small launch, with busy loops beside: what was flown is told and kept."""

import random
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from rsc_swarm.machine.leaving import passing_folder
from rsc_swarm.selfcheck.watched import EARLY, SMALL, Seen, busy, common_faults, length_of_launch, start

_LOOPS = 2


def press(seed: int, length_s: float, here: Path) -> tuple[float, Seen]:
    """Press Ctrl-C, as a terminal does it, after a part of ``length_s`` that the ``seed`` decides; when, and what came of it."""
    dice = random.Random(seed)
    verb, at = dice.choice(["launch", "launch", "simulate"]), dice.uniform(0.0, length_s)
    watched = start([verb, "--agents", str(dice.randint(3, 6)), *SMALL], here)
    begin = time.monotonic()
    time.sleep(at)
    watched.strike("everybody", signal.SIGINT)
    return time.monotonic() - begin, watched.end()


def judge(seen: Seen, early: bool) -> list[str]:
    """What is wrong with it; nothing if it is as it should be."""
    faults = common_faults(seen, early)
    if seen.flew or seen.out:
        faults += [] if seen.report else ["the report is lost"]
        faults += [] if seen.trajectory else ["the trajectory is lost"]
        faults += [] if seen.out else ["nothing was told"]
    elif seen.code != 130:
        faults.append(f"exit code {seen.code} before anything was flown")
    return faults


def check(runs: int, seed: int, say: Callable[[str], None]) -> Iterator[tuple[int, str]]:
    """As rsc_swarm.selfcheck.machine.check."""
    with busy(_LOOPS):
        length_s = length_of_launch()
        for number in range(seed, seed + runs):
            with passing_folder("rsc-swarm-check-") as folder:
                at, seen = press(number, length_s, folder)
            faults = judge(seen, at < EARLY * length_s)
            say(f"{number}: Ctrl-C after {at:.2f} s: {'; '.join(faults) or 'as it should be'}")
            if faults:
                yield number, f"Ctrl-C after {at:.2f} s: {'; '.join(faults)}"
