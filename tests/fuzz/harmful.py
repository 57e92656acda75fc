"""What once did harm, or well might: by target and name.

Texts of this kind lie as files in ``corpus``.
"""

from functools import cache

from tests.fuzz import harmful_files as files
from tests.fuzz import harmful_messages as messages
from tests.fuzz.harmful_messages import MSGPACK

_MADE = {
    "frame": messages.frames, "heard": messages.heard, "note": messages.notes, "status": messages.statuses,
    "from-drone": messages.from_drone, "from-world": messages.from_world, "pieces": messages.pieces,
    "login": files.logins, "world-keys": files.world_keys, "recording": files.recordings,
    "checkpoint": files.checkpoints, "model": files.models, "mission": files.missions, "description": files.descriptions,
}  # fmt: skip
_IN_MSGPACK = ("note", "status", "from-drone", "from-world")


@cache
def harmful(target: str) -> dict[str, bytes]:
    """By name, for the target called ``target``."""
    return {**(MSGPACK if target in _IN_MSGPACK else {}), **dict(_MADE[target]() if target in _MADE else ())}
