"""What the world must know to tell its drones from strangers: their passwords and, with keys, its own certificates."""

import secrets
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import NamedTuple

from pydantic import TypeAdapter

from protocols.wire.keys import MAX_AGENTS, checked_swarm, user
from protocols.wire.login import Certificates, Login, Password, from_json, to_json


@dataclass(frozen=True)
class Credentials:
    """Of one swarm: ``passwords[i]`` is agent ``i``'s; certificates: the world's own, for ``tls`` and ``quic``.

    Its secrets do not show when it is printed.
    """

    swarm: str
    passwords: tuple[Password, ...] = field(repr=False)
    certificates: Certificates | None = None

    @staticmethod
    def fresh(swarm: str, agents: int) -> "Credentials":
        """New passwords for agents 0 to ``agents - 1``, from the operating system's randomness."""
        if not 1 <= agents <= MAX_AGENTS:
            raise ValueError(f"a swarm has 1 to {MAX_AGENTS} agents, not {agents}")
        return Credentials(checked_swarm(swarm), tuple(secrets.token_urlsafe(24) for _ in range(agents)))

    def login(self, agent: int, certificates: Certificates | None = None) -> Login:
        """Agent ``agent``'s, with its own certificates if it has some."""
        return Login(self.swarm, agent, self.passwords[agent], certificates)

    def dictionary(self) -> str:
        """The router's list of logins, one ``user:password`` per line."""
        return "".join(f"{user(agent)}:{word}\n" for agent, word in enumerate(self.passwords))

    def to_json(self) -> str:
        return to_json(_CREDENTIALS, self)

    @staticmethod
    def from_json(text: str) -> "Credentials":
        """Raises ValueError when ``text`` is not what ``to_json`` wrote, or its certificates are not a world's."""
        credentials = from_json(_CREDENTIALS, text, "the world's file of a swarm's keys")
        checked_swarm(credentials.swarm)
        if not 1 <= len(credentials.passwords) <= MAX_AGENTS:
            raise ValueError(f"is of {len(credentials.passwords)} drones: a swarm has 1 to {MAX_AGENTS}")
        if credentials.certificates:
            from protocols.wire.certificates import WORLD, checked_certificates  # loaded only where needed

            checked_certificates(credentials.certificates, WORLD)
        return credentials


_CREDENTIALS = TypeAdapter(Credentials)


class Keys(NamedTuple):
    """What the world and each drone of a swarm are given, for all its flights."""

    world: Credentials
    logins: tuple[Login, ...]


def make_keys(swarm: str, agents: int, addresses: Sequence[str], days: int, now: datetime) -> Keys:
    """New passwords and certificates; arguments and errors as `protocols.wire.certificates.make_certificates`."""
    from protocols.wire.certificates import make_certificates

    fresh = Credentials.fresh(swarm, agents)
    made = make_certificates(swarm, agents, addresses, days, now)
    return Keys(
        Credentials(swarm, fresh.passwords, made.world),
        tuple(fresh.login(agent, own) for agent, own in enumerate(made.agents)),
    )
