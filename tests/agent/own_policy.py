"""A policy of one's own in a file, and a mission that it flies."""

from pathlib import Path
from typing import Any

from protocols.mission.document import Mission, parse_mission

HOMING = """
class Homing:
    def __init__(self, mission):
        pass

    def act(self, seen):
        return seen.slot_error + 0.0
"""


def written(folder: Path, text: str, name: str = "homing.py") -> str:
    """The name of the policy ``Homing`` in a file with this text."""
    (folder / name).write_text(text)
    return f"{folder / name}:Homing"


def task(policy: str, **fields: Any) -> Mission:
    return parse_mission({"agents": 6, "policy": policy, "obstacles": {"discs": []}, **fields})
