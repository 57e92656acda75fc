"""One Ctrl-C at a random moment of a small launch, with busy loops beside: what was flown is told and kept."""

import random
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from rsc_swarm.machine.leaving import passing_folder
from rsc_swarm.selfcheck.watched import EARLY, SMALL, Seen, busy, common_faults, length_of, start

_LOOPS = 2


class Trial(NamedTuple):
    """What is started, after how many seconds Ctrl-C is pressed, and how many drones fly."""

    verb: str
    at_s: float
    agents: int


def draw(seed: int, length_s: float) -> Trial:
    """The trial of this seed; ``length_s``: Ctrl-C is pressed within so many seconds."""
    dice = random.Random(seed)
    return Trial(
        dice.choice(["launch", "launch", "simulate"]), dice.uniform(0.0, length_s), dice.randint(3, 6)
    )


def press(trial: Trial, here: Path) -> tuple[float, Seen]:
    """Press Ctrl-C, as a terminal does it; when that really was, s, and what came of it."""
    verb, at, agents = trial
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
            trial = draw(number, length_s)
            with passing_folder("rsc-swarm-check-") as folder:
                at, seen = press(trial, folder)
            faults = judge(seen, at < EARLY * lengths_s[trial.verb])
            say(f"{number}: Ctrl-C after {at:.2f} s: {'; '.join(faults) or 'as it should be'}")
            if faults:
                yield number, f"Ctrl-C after {at:.2f} s: {'; '.join(faults)}"
