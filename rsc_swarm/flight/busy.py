"""What a drone's process is busy with, asked from outside: where a policy is that does not return.

Whatever the process does, even within compiled code, it answers by writing its stack into its log.
"""

import faulthandler
import os
import re
import signal
import time
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from agent.policy import asking
from world.outcome import Flown

STDERR = 2
_ASK = signal.SIGUSR1
_ANSWER_S = 1.0
_FRAME = re.compile(r'^  File "(.+)", line (\d+) in (.+)$', re.MULTILINE)


def answer(log: int = STDERR) -> None:
    """From now on this process says where it is when it is asked: into what is open as ``log``."""
    faulthandler.register(_ASK, file=log, all_threads=True)


def explained(flown: Flown, busy: Mapping[int, str]) -> Flown:
    """The same flight; of the drones that were struck off it says in which policy they were ``busy``."""
    struck_off = [
        one._replace(why=f"{one.why}; its policy has not returned from {busy[one.agent]}")
        if one.agent in busy
        else one
        for one in flown.outcome.struck_off
    ]
    return replace(flown, outcome=replace(flown.outcome, struck_off=tuple(struck_off)))


def busy_at(process: int, log: Path) -> str | None:
    """Where in a policy this process is, as ``homing.py:14 (act)``; None if in none, or if it does not say.

    Args:
        log: where what the process writes goes.
    """
    begin = log.stat().st_size
    os.kill(process, _ASK)
    deadline = time.monotonic() + _ANSWER_S
    while time.monotonic() < deadline:
        with log.open("rb") as file:
            file.seek(begin)
            if place := _in_policy(file.read().decode(errors="replace")):
                return place
        time.sleep(0.02)
    return None


def _in_policy(stack: str) -> str | None:
    """The innermost place in the file of the policy that is being asked; ``stack``: innermost first."""
    frames = _FRAME.findall(stack)
    for (file, _, _), (asking_file, _, asking_function) in pairwise(frames):
        if (asking_file, asking_function) == (asking.__file__, asking.call.__name__):
            place, line, function = next(frame for frame in frames if frame[0] == file)
            return asking.at(place, int(line), function)
    return None
