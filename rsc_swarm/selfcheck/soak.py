"""Launches in a row, for long: does anything grow? The memory of launcher, world and drones, and the files they have open."""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple

import psutil

from protocols.mission.document import Mission, parse_mission
from rsc_swarm.flight.launch import launch
from rsc_swarm.machine.census import anonymous_bytes
from world.outlets.snapshot import Snapshot

_MISSION = {"agents": 4, "goal_x_m": 1e6, "obstacles": {"discs": []}, "fly_s": 60}
_SETTLED = 1000  # ticks: what grows afterwards grows for ever
_GROWS = 0.01


class Size(NamedTuple):
    """Of one process: bytes it took for itself (not those of libraries), and files it has open."""

    bytes: int
    files: int


@dataclass
class Growth:
    """Of one kind of process: its sizes, one a launch, in their order."""

    name: str
    sizes: list[Size]

    @property
    def memory(self) -> float:
        """How much more memory the last third of the launches took than the first, relative, at their medians."""
        third = max(1, len(self.sizes) // 3)
        first, last = ([size.bytes for size in part] for part in (self.sizes[:third], self.sizes[-third:]))
        return median(last) / median(first) - 1.0

    @property
    def files(self) -> tuple[int, int]:
        """Fewest and most files open."""
        return min(size.files for size in self.sizes), max(size.files for size in self.sizes)

    @property
    def grows(self) -> bool:
        """Whether memory grew by more than 1 %, or the number of open files changed."""
        return self.memory > _GROWS or self.files[0] != self.files[1]

    def __str__(self) -> str:
        sizes = [size.bytes / 1e6 for size in self.sizes]
        least, most = self.files
        return (
            f"{self.name:9s} {sizes[0]:6.1f} MB at first, {sizes[-1]:6.1f} at last ({100 * self.memory:+.2f} % over thirds), "
            f"{least} to {most} files open"
        )


def soak(minutes: float, say: Callable[[str], None]) -> tuple[int, list[Growth]]:
    """Launch again and again from this process for so long; how often, and what grew.

    Raises:
        rsc_swarm.flight.launch.RunBroken: a launch broke.
    """
    growths = {name: Growth(name, []) for name in ("launcher", "world", "drones", "in flight")}
    mission = parse_mission(_MISSION)
    until, launches = time.monotonic() + 60.0 * minutes, 0
    while time.monotonic() < until:
        world, drones, flight = _one(mission)
        launches += 1
        for name, size in (("launcher", _size(psutil.Process())), ("world", world), ("drones", drones)):
            growths[name].sizes.append(size)
        growths["in flight"].sizes += flight if launches == 1 else ()
        say(
            f"launch {launches}: "
            + ", ".join(f"{name} {growth.sizes[-1].bytes / 1e6:.1f} MB" for name, growth in growths.items())
        )
    return launches, list(growths.values())


def _one(mission: Mission) -> tuple[Size, Size, list[Size]]:
    """Launch once: sizes of the world and, added up, of the drones in the middle; and of all of them, again and again."""
    taken: list[tuple[Size, Size]] = []

    def weigh(picture: Snapshot) -> None:
        children = psutil.Process().children()  # the world was started first
        if picture.tick >= _SETTLED and len(children) == mission.agents + 1:
            with suppress(psutil.Error):  # the flight is over, and one of them with it
                sizes = [_size(process) for process in children]
                taken.append((sizes[0], _sum(sizes[1:])))

    launch(mission, on_snapshot=weigh).whole()
    world, drones = taken[len(taken) // 2]  # in the end some are leaving
    return world, drones, [_sum(pair) for pair in taken[:-1]]


def _sum(sizes: tuple[Size, ...] | list[Size]) -> Size:
    return Size(sum(size.bytes for size in sizes), sum(size.files for size in sizes))


def _size(process: psutil.Process) -> Size:
    return Size(anonymous_bytes(process.pid), process.num_fds())
