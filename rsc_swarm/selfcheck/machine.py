"""Faults of the machine at random moments of small launches: whatever comes, it is told in one line, and nothing is left or lost.

Which fault, whom it strikes and when is drawn from the seed. Time is counted from when the command answers signals, in shares of
what an undisturbed launch takes here.
"""

import random
import resource
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from rsc_swarm.machine.leaving import passing_folder
from rsc_swarm.selfcheck.watched import (
    ASKING,
    EARLY,
    SMALL,
    Seen,
    Watched,
    common_faults,
    length_of,
    start,
)

_STOPPED_S = 0.7  # of a process that is stopped and goes on
_FULL = {"": "", "stdout": ">/dev/full", "stderr": "2>/dev/full", "closed": ">&-", "closed stderr": "2>&-"}


@dataclass(frozen=True)
class Strike:
    """After this share of a launch, this signal to this process (or ``everybody``); who was stopped goes on after a while."""

    share: float
    whom: str
    number: signal.Signals


@dataclass(frozen=True)
class Plan:
    """One run. limits: by number of the resource. streams: which one is full or closed."""

    agents: int
    clock: str
    strikes: tuple[Strike, ...]
    limits: tuple[tuple[int, int], ...]
    streams: str

    def __str__(self) -> str:
        strikes = [f"{strike.number.name} to {strike.whom} at {strike.share:.2f}" for strike in self.strikes]
        names = {
            resource.RLIMIT_FSIZE: "file size",
            resource.RLIMIT_NOFILE: "open files",
            resource.RLIMIT_AS: "addresses",
        }
        limits = [f"{names[number]} {limit}" for number, limit in self.limits]
        return f"{self.agents} drones, {self.clock}: " + ", ".join(
            [*strikes, *limits, *filter(None, [self.streams])]
        )

    @property
    def loses_world(self) -> bool:
        """Whether the world may be killed, and what it recorded with it."""
        return any(
            strike.number is signal.SIGKILL and strike.whom in ("world", "everybody")
            for strike in self.strikes
        )

    @property
    def asks_early(self) -> bool:
        """Whether it is asked to leave while it cannot be over yet."""
        return any(strike.number in ASKING and strike.share < EARLY for strike in self.strikes)

    @property
    def kills_launcher(self) -> bool:
        """Whether the launcher is killed outright."""
        return any(
            strike.number is signal.SIGKILL and strike.whom in ("launcher", "everybody")
            for strike in self.strikes
        )


def draw(seed: int) -> Plan:
    """The run of this seed."""
    dice = random.Random(seed)
    agents = dice.randint(3, 6)
    names = ["launcher", "world", f"agent-{dice.randrange(agents)}"]
    kind = dice.choice(["asked", "asked", "killed", "killed", "stopped", "disk", "limit", "streams"])
    strikes: list[Strike] = []
    limits: list[tuple[int, int]] = []
    streams = ""
    if kind == "asked":
        first = dice.uniform(0.0, 1.1)
        for share in (first, first + dice.expovariate(20.0))[: dice.randint(1, 2)]:
            number = dice.choice(ASKING)  # a terminal tells everybody of the first and the last
            whom = "launcher" if number is signal.SIGTERM else dice.choice(["launcher", "everybody"])
            strikes.append(Strike(share, whom, number))
    elif kind == "killed":
        strikes.append(Strike(dice.uniform(0.0, 1.1), dice.choice(names), signal.SIGKILL))
    elif kind == "stopped":
        strikes.append(Strike(dice.uniform(0.0, 1.0), dice.choice(names), signal.SIGSTOP))
        if dice.random() < 0.5:
            strikes.append(Strike(strikes[0].share + 0.05, dice.choice(names), signal.SIGKILL))
    elif kind == "disk":
        limits.append((resource.RLIMIT_FSIZE, dice.choice([0, 1000, 5000, 20000])))
    elif kind == "limit":
        few = (resource.RLIMIT_NOFILE, dice.randint(12, 90))
        limits.append(dice.choice([few, (resource.RLIMIT_AS, dice.randint(400, 2400) << 20)]))
    if kind == "streams" or dice.random() < 0.1:
        streams = dice.choice(list(_FULL)[1:])
    return Plan(
        agents, "realtime" if dice.random() < 0.2 else "lockstep", tuple(strikes), tuple(limits), streams
    )


def fly(plan: Plan, here: Path, length_s: float) -> Seen:
    """Carry out ``plan`` in the empty folder ``here``; a launch takes about ``length_s``."""

    def limit() -> None:
        for number, most in plan.limits:
            resource.setrlimit(number, (most, most))

    words = ["launch", "--agents", str(plan.agents), "--clock", plan.clock, *SMALL]
    watched = start(words, here, limit, _FULL[plan.streams])
    begin = time.monotonic()
    events: list[tuple[float, str, signal.Signals]] = []
    for strike in plan.strikes:
        at = strike.share * length_s
        events.append((at, strike.whom, strike.number))
        if strike.number is signal.SIGSTOP:
            events.append((at + _STOPPED_S, strike.whom, signal.SIGCONT))
    for at, whom, number in sorted(events):
        _wait(watched, begin + at)
        watched.strike(whom, number)
    return watched.end()


def _wait(watched: Watched, until: float) -> None:
    while watched.process.poll() is None and (left := until - time.monotonic()) > 0.0:
        time.sleep(min(left, 0.02))


def judge(plan: Plan, seen: Seen) -> list[str]:
    """What is wrong with a run; nothing if it is as it should be."""
    if plan.kills_launcher and seen.code == -signal.SIGKILL:
        seen.code = 0  # nobody is left who could tell
    troubles = max(1, bool(plan.limits) + bool(plan.streams))
    faults = common_faults(seen, plan.asks_early, troubles)
    if "stderr" in plan.streams:
        return [fault for fault in faults if "complain" not in fault]
    if seen.flew and not plan.limits:
        if not seen.report:
            faults.append("the report is lost")
        if not seen.trajectory and not plan.loses_world:
            faults.append("the trajectory is lost")
    if plan.limits and seen.flew and not (plan.streams or seen.out):
        faults.append("what was flown was not told")
    return faults


def check(runs: int, seed: int, say: Callable[[str], None]) -> Iterator[tuple[int, str]]:
    """Fly ``runs`` plans from ``seed`` on; yields seed and what is wrong, of those that are not as they should be."""
    length_s = length_of("launch")
    for number in range(seed, seed + runs):
        plan = draw(number)
        with passing_folder("rsc-swarm-check-") as folder:
            seen = fly(plan, folder, length_s)
        faults = judge(plan, seen)
        say(
            f"{number}: {plan}: "
            + ("; ".join(faults) if faults else f"exit code {seen.code}, as it should be")
        )
        if faults:
            yield number, f"{plan}: {'; '.join(faults)}"
