"""A moment of a flight in one line, and its pieces."""

import math

from world.outlets.snapshot import Snapshot


def line(snapshot: Snapshot) -> str:
    """One moment in one line."""
    flying = [row for row in snapshot.agents if row.state != "lost"]
    nearest = min((row.nearest_m for row in flying), default=math.inf)
    edge = max((row.edge_error for row in flying), default=0.0)
    text = f"t {snapshot.time_s:6.2f} s  {snapshot.real_time_factor:5.1f} x real time{passed(snapshot, '  ')}"
    if math.isfinite(nearest):
        text += f"  nearest {nearest:5.2f} m"
    if len(snapshot.agents) > 1:
        text += f"  worst edge {100 * edge:4.0f} %  swaps {swaps(snapshot)}"
    lost = len(snapshot.agents) - len(flying)
    return text + (f"  lost {lost}" if lost else "") + late(snapshot)


def swaps(snapshot: Snapshot) -> int:
    """Swaps that took place so far."""
    return snapshot.swaps["committed"] + snapshot.swaps["vacated"]


def passed(snapshot: Snapshot, gap: str) -> str:
    """Nothing in a field without obstacles."""
    passed = f"{gap}obstacles passed {snapshot.obstacles_passed}/{snapshot.obstacles}"
    return passed if snapshot.obstacles else ""


def late(snapshot: Snapshot) -> str:
    return f"  late answers {snapshot.deadline_misses}" if snapshot.deadline_misses else ""
