"""``rsc-swarm bench --against DIR``: the code here beside another checkout's, flown in turn.

A machine's speed wanders, so each pair is flown one right after the other, every second pair the other way round, and what
counts is the median of the pairs' ratios. Before each pair comes the bare echo (rsc_swarm.bench.echo) of messages as long as
those of 25 drones, here only: what talking alone costs, less than which no flight can. CPU time and context switches are counted
over all processes, in the last four fifths of a flight; they wander less than times do.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import psutil

from protocols.dynamics import TICK_S
from protocols.errors import BrokenError, SwarmError
from rsc_swarm.machine.leaving import passing_folder

_LOOK_S = 0.1
_SHARE = 0.8  # of the flight, its end: by then all has been loaded
ECHO = "bare echo"
_ECHO_UP_BYTES, _ECHO_DOWN_BYTES, _ECHO_TICKS = 201, 673, 2000
_ECHO = f"""
import json, sys
from pathlib import Path
from rsc_swarm.bench.echo import bare_echo
rate = bare_echo(int(sys.argv[1]), {_ECHO_UP_BYTES}, {_ECHO_DOWN_BYTES}, {_ECHO_TICKS})
told = {{"real_time_factor": rate * {TICK_S}, "time_s": {_ECHO_TICKS * TICK_S}}}
Path(sys.argv[2]).write_text(json.dumps(told))
"""


class AgainstError(SwarmError, ValueError):
    """There is nothing to compare with; one line says why."""


class Cost(NamedTuple):
    """What a launch cost a tick.

    world_us, drone_us: CPU time. switches: context switches of all processes. real_time_factor. pss_mb: memory of one drone.
    """

    real_time_factor: float
    world_us: float
    drone_us: float
    switches: float
    pss_mb: float


class _Look(NamedTuple):
    """A moment: s of CPU time and context switches so far, by process."""

    at_s: float
    spent: dict[int, tuple[float, int]]


def against(
    other: Path,
    agents: int,
    policies: tuple[str, ...],
    pairs: int,
    say: Callable[[str], None] = lambda line: None,
) -> dict[str, dict[str, list[Cost]]]:
    """Fly ``pairs`` pairs of launches by each policy; what they cost, by policy, ``here`` and ``there``, and `ECHO` ``here``.

    Raises:
        AgainstError: ``other`` is no checkout. protocols.errors.BrokenError: a launch broke.
    """
    here = Path(__file__).parents[2]
    if not (other / "rsc_swarm" / "__main__.py").is_file():
        raise AgainstError(f"{other}: is no checkout of rsc-swarm: there is no rsc_swarm/__main__.py")
    sides = {"here": here, "there": other.resolve()}
    for name, folder in sides.items():
        say(f"what is compiled, {name}")
        for policy in policies:
            _fly(folder, agents, policy, 0)
    costs: dict[str, dict[str, list[Cost]]] = {policy: {side: [] for side in sides} for policy in policies}
    costs[ECHO] = {"here": []}
    for pair in range(pairs):
        say(f"pair {pair + 1} of {pairs}, {ECHO}")
        costs[ECHO]["here"].append(_fly(here, agents, ECHO, pair))
        for policy in policies:
            say(f"pair {pair + 1} of {pairs}, {policy}")
            for side in (*sides,)[:: -1 if pair % 2 else 1]:
                costs[policy][side].append(_fly(sides[side], agents, policy, pair))
    return costs


def render(costs: dict[str, dict[str, list[Cost]]], agents: int) -> str:
    """The medians as a table for people: here, there, and the median of the pairs' ratios."""
    lines = [f"{agents} drones in {agents} processes{'here':>24}{'there':>10}{'here / there':>15}"]
    names = {
        "real_time_factor": "x real time", "world_us": "us of CPU a tick, the world", "drone_us": "us of CPU a tick, one drone",
        "switches": "context switches a tick, all", "pss_mb": "MB, one drone (PSS)",
    }  # fmt: skip
    for policy, sides in costs.items():
        for field, name in names.items():
            by_side = {side: [getattr(cost, field) for cost in flown] for side, flown in sides.items()}
            line = f"{policy:10s} {name:32s}" + "".join(f"{median(side):10.4g}" for side in by_side.values())
            if len(by_side) == 2:
                ratio = median(one / two for one, two in zip(*by_side.values(), strict=True))
                line += f"{ratio:15.2f}"
            if any(by_side["here"]):  # an echo's memory is not looked at
                lines.append(line)
    return "\n".join(lines)


def _fly(folder: Path, agents: int, policy: str, map_seed: int) -> Cost:
    """One launch, or bare echo, of the checkout in ``folder``."""
    with passing_folder("rsc-swarm-bench-") as place:
        report = place / "report.json"
        launch = f"-m rsc_swarm launch --agents {agents} --map {map_seed} --policy {policy} --json".split()
        words = ["-c", _ECHO, str(agents)] if policy == ECHO else launch
        command = [sys.executable, *words, str(report)]
        environment = {**os.environ, "PYTHONPATH": str(folder)}
        with subprocess.Popen(
            command, cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        ) as launched:
            looks = list(_looks(launched, agents + 1))
            assert launched.stderr is not None
            said = launched.stderr.read().strip()
        try:
            told: dict[str, Any] = json.loads(report.read_text())
        except (OSError, ValueError):
            raise BrokenError(
                f"{folder}: a launch broke: {said.splitlines()[-1] if said else 'it said nothing'}"
            ) from None
    return _cost(looks, told)


def _looks(launched: "subprocess.Popen[str]", processes: int) -> Iterator[_Look]:
    """Looks at the processes of a launch while all are there."""
    launcher = psutil.Process(launched.pid)
    while launched.poll() is None:
        time.sleep(_LOOK_S)
        try:
            spent = {child.pid: _spent(child.pid) for child in launcher.children()}
        except (psutil.Error, OSError):
            continue
        if len(spent) >= processes:
            yield _Look(time.monotonic(), spent)


def _spent(pid: int) -> tuple[float, int]:
    """CPU time [s] and context switches of all threads of a process so far."""
    switches = 0
    for thread in Path(f"/proc/{pid}/task").iterdir():
        for line in (thread / "status").read_text().splitlines():
            if "ctxt_switches" in line:
                switches += int(line.split()[1])
    times = psutil.Process(pid).cpu_times()
    return times.user + times.system, switches


def _cost(looks: list[_Look], told: dict[str, Any]) -> Cost:
    factor, pss_mb = told["real_time_factor"], told.get("pss_mb_per_agent") or 0.0
    wall_s = told["time_s"] / factor if factor else 0.0
    if len(looks) < 2:
        return Cost(factor, 0.0, 0.0, 0.0, pss_mb)
    last = looks[-1]
    first = min(looks, key=lambda look: abs(look.at_s - (last.at_s - _SHARE * wall_s)))
    ticks = max((last.at_s - first.at_s) * factor / TICK_S, 1.0)
    spent = sorted(
        (
            (1e6 * (after[0] - first.spent[pid][0]) / ticks, (after[1] - first.spent[pid][1]) / ticks)
            for pid, after in last.spent.items()
            if pid in first.spent
        ),
        reverse=True,
    )
    (world_us, _), *drones = spent  # no drone works as much as the world
    drone_us = sum(us for us, _ in drones) / max(len(drones), 1)
    return Cost(factor, world_us, drone_us, sum(switches for _, switches in spent), pss_mb)
