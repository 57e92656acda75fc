"""One Ctrl-C at a random moment of a small launch, with busy loops beside: what was flown is told and kept."""

import random
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from rsc_swarm.machine.leaving import passing_folder
from rsc_swarm.selfcheck.watched import EARLY, SMALL, Seen, busy, common_faults, length_of, start

_LOOPS = 2


def _drawn(seed: int, length_s: float) -> tuple[str, float, int]:
    """What is started, after how many seconds of ``length_s`` Ctrl-C is pressed, and how many drones fly."""
    dice = random.Random(seed)
    return dice.choice(["launch", "launch", "simulate"]), dice.uniform(0.0, length_s), dice.randint(3, 6)


def press(seed: int, length_s: float, here: Path) -> tuple[float, Seen]:
    """Press Ctrl-C, as a terminal does it, after a part of ``length_s`` that the ``seed`` decides; when, and what came of it."""
    verb, at, agents = _drawn(seed, length_s)
    watched = start([verb, "--agents", str(agents), *SMALL], here)
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
        lengths_s = {verb: length_of(verb) for verb in ("launch", "simulate")}
        length_s = lengths_s["launch"]
        for number in range(seed, seed + runs):
            with passing_folder("rsc-swarm-check-") as folder:
                at, seen = press(number, length_s, folder)
            verb, *_ = _drawn(number, length_s)
            faults = judge(seen, at < EARLY * lengths_s[verb])
            say(f"{number}: Ctrl-C after {at:.2f} s: {'; '.join(faults) or 'as it should be'}")
            if faults:
                yield number, f"Ctrl-C after {at:.2f} s: {'; '.join(faults)}"
