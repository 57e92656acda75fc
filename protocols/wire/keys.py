"""What the parties of a swarm call each other: key expressions, user names, logins and endpoints.

- Agent ``i`` of swarm ``s`` speaks on ``s/tx/i`` and hears on ``s/rx/i``. Both carry opaque bytes.
- The world hears everyone on ``s/tx/*`` and speaks on each ``s/rx/i``. No agent hears another's key.
- A swarm's name is one chunk of a key expression: a letter or digit, then letters, digits, ``-`` and ``_``.
"""

import json
import re
from typing import NamedTuple

from protocols.errors import BrokenError

MAX_AGENTS = 250  # agent numbers travel as one byte
LEASE_MS = (
    24 * 3_600_000
)  # Zenoh would otherwise take who is stopped for ten seconds for gone, and lose what was under way

# The protocols that both ends speak; what follows the port is left to Zenoh.
_ENDPOINT = re.compile(r"unixsock-stream/.+|(tcp|tls|quic|ws)/.+:\d+.*")
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


def checked_endpoint(endpoint: str) -> str:
    """``endpoint`` itself if it reads like the address of a world, else LinkError."""
    if not _ENDPOINT.fullmatch(endpoint):
        raise LinkError(
            f"{endpoint!r} is not an endpoint: an endpoint reads unixsock-stream//folder/world.sock "
            "or tcp/ADDRESS:PORT, for example tcp/192.168.1.10:7447"
        )
    return endpoint


def _checked_agent(agent: int) -> int:
    if not 0 <= agent < MAX_AGENTS:
        raise ValueError(f"{agent} is not an agent: agents are numbered 0 to {MAX_AGENTS - 1}")
    return agent


def tx(swarm: str, agent: int) -> str:
    """Where ``agent`` speaks: its commands and its broadcast frames, heard by the world only."""
    return f"{checked_swarm(swarm)}/tx/{_checked_agent(agent)}"


def rx(swarm: str, agent: int) -> str:
    """Where ``agent`` hears: what its sensors and its radio bring, spoken by the world only."""
    return f"{checked_swarm(swarm)}/rx/{_checked_agent(agent)}"


def every_tx(swarm: str) -> str:
    """Where the world hears all agents at once."""
    return f"{checked_swarm(swarm)}/tx/*"


def user(agent: int) -> str:
    """The name under which ``agent`` logs in."""
    return f"agent-{_checked_agent(agent)}"


class Login(NamedTuple):
    """All an agent must know, besides an endpoint, to join a swarm as itself."""

    swarm: str
    agent: int
    password: str

    def to_json(self) -> str:
        return json.dumps(self._asdict(), indent=2) + "\n"

    @staticmethod
    def from_json(text: str) -> "Login":
        """Raises ValueError when ``text`` is not what ``to_json`` wrote."""
        try:
            read = json.loads(text)
            login: Login | None = Login(read["swarm"], read["agent"], read["password"])
        except (ValueError, TypeError, KeyError, RecursionError):
            login = None
        if login is None or tuple(map(type, login)) != (str, int, str):
            raise ValueError(
                "not an agent's login: a login is a JSON object with 'swarm', 'agent' and 'password', "
                "as the world of the swarm writes it"
            )
        checked_swarm(login.swarm)
        _checked_agent(login.agent)
        return login
