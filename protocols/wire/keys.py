"""What the parties of a swarm call each other: key expressions and user names.

- Agent ``i`` of swarm ``s`` speaks on ``s/tx/i`` and hears on ``s/rx/i``. Both carry opaque bytes.
- The world hears everyone on ``s/tx/*`` and speaks on each ``s/rx/i``. No agent hears another's key.
- A swarm's name is one chunk of a key expression: a letter or digit, then letters, digits, ``-`` and ``_``.
"""

import re

from protocols.errors import BrokenError

MAX_AGENTS = 250  # of processes that talk; more would need longer frames and messages
_SWARM_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")


class LinkError(BrokenError, RuntimeError):
    """A link could not be opened. The message is one line: what is wrong, and what would be right."""


def checked_swarm(swarm: str) -> str:
    """``swarm`` itself if it is a valid swarm name, else ValueError."""
    if not _SWARM_NAME.fullmatch(swarm):
        raise ValueError(
            f"{swarm!r} is not a swarm name: use 1 to 64 letters, digits, '-' and '_', "
            "beginning with a letter or digit, for example 'wedge-1'"
        )
    return swarm


def checked_agent(agent: int) -> int:
    """``agent`` itself if it may be an agent's number, else ValueError."""
    if not 0 <= agent < MAX_AGENTS:
        raise ValueError(f"{agent} is not an agent: agents are numbered 0 to {MAX_AGENTS - 1}")
    return agent


def tx(swarm: str, agent: int) -> str:
    """Where ``agent`` speaks: its commands and its broadcast frames, heard by the world only."""
    return f"{checked_swarm(swarm)}/tx/{checked_agent(agent)}"


def rx(swarm: str, agent: int) -> str:
    """Where ``agent`` hears: what its sensors and its radio bring, spoken by the world only."""
    return f"{checked_swarm(swarm)}/rx/{checked_agent(agent)}"


def every_tx(swarm: str) -> str:
    """Where the world hears all agents at once."""
    return f"{checked_swarm(swarm)}/tx/*"


def pulse(swarm: str) -> str:
    """Where the world, and nobody else, puts a beat into what it hears, so that no wait is endless."""
    return f"{checked_swarm(swarm)}/tx/pulse"


def user(agent: int) -> str:
    """The name under which ``agent`` logs in."""
    return f"agent-{checked_agent(agent)}"


def login_file(agent: int) -> str:
    """What the file is called that ``agent`` logs in with."""
    return f"{user(agent)}.json"
