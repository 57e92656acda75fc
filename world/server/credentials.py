"""What the world must know to tell its drones from strangers: their passwords and, with keys, its own certificates."""

import secrets
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import NamedTuple

from protocols.wire.keys import MAX_AGENTS, checked_swarm, user
from protocols.wire.login import Certificates, Login, OperatorLogin, Password, SealKeys, from_json, to_json


@dataclass(frozen=True)
class Credentials:
    """Of one swarm: ``passwords[i]`` is agent ``i``'s; certificates: the world's own, for ``tls`` and ``quic``. seals: only
    where the logins of the drones are still to be made: the world itself seals nothing.

    Its secrets do not show when it is printed.
    """

    swarm: str
    passwords: tuple[Password, ...] = field(repr=False)
    certificates: Certificates | None = None
    seals: tuple[SealKeys, ...] | None = field(default=None, repr=False)

    @staticmethod
    def fresh(swarm: str, agents: int) -> "Credentials":
        """New passwords and seals for agents 0 to ``agents - 1``, from the operating system's randomness."""
        if not 1 <= agents <= MAX_AGENTS:
            raise ValueError(f"a swarm has 1 to {MAX_AGENTS} agents, not {agents}")
        passwords = tuple(secrets.token_urlsafe(24) for _ in range(agents))
        return Credentials(checked_swarm(swarm), passwords, seals=_fresh_seals(agents))

    def login(self, agent: int, certificates: Certificates | None = None) -> Login:
        """Agent ``agent``'s, with its own certificates if it has some."""
        seals = self.seals[agent] if self.seals else None
        return Login(self.swarm, agent, self.passwords[agent], certificates, seals)

    def dictionary(self) -> str:
        """The router's list of logins, one ``user:password`` per line."""
        return "".join(f"{user(agent)}:{word}\n" for agent, word in enumerate(self.passwords))

    def to_json(self) -> str:
        return to_json(self)

    @staticmethod
    def from_json(text: str) -> "Credentials":
        """Raises ValueError when ``text`` is not what ``to_json`` wrote, or its certificates are not a world's."""
        credentials = from_json(Credentials, text, "the world's file of a swarm's keys")
        checked_swarm(credentials.swarm)
        if not 1 <= len(credentials.passwords) <= MAX_AGENTS:
            raise ValueError(f"is of {len(credentials.passwords)} drones: a swarm has 1 to {MAX_AGENTS}")
        if credentials.certificates:
            from protocols.wire.certificates import WORLD, checked_certificates  # loaded only where needed

            checked_certificates(credentials.certificates, WORLD)
        return credentials


def _fresh_seals(agents: int) -> tuple[SealKeys, ...]:
    from protocols.slots.signatures import KEY_BYTES, public_key  # loaded only where keys are made or used

    private = [secrets.token_bytes(KEY_BYTES) for _ in range(agents)]
    public = tuple(public_key(key).hex() for key in private)
    return tuple(SealKeys(key.hex(), public) for key in private)


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


class FleetHosts(NamedTuple):
    """Where those of a fleet are reached: each drone, the operator, and the world of mixed reality if there is one."""

    drones: Sequence[str]
    ground: str
    world: str | None = None


class FleetKeys(NamedTuple):
    """What those of a fleet are given."""

    operator: OperatorLogin
    logins: tuple[Login, ...]
    world: OperatorLogin | None


def make_fleet_keys(swarm: str, hosts: FleetHosts, days: int, now: datetime) -> FleetKeys:
    """New keys of a fleet; errors as `protocols.wire.certificates.make_peer_certificates`."""
    from protocols.wire.certificates import OPERATOR, WORLD, make_peer_certificates

    fresh, names = Credentials.fresh(swarm, len(hosts.drones)), list(map(user, range(len(hosts.drones))))
    reached = {OPERATOR: hosts.ground, **dict(zip(names, hosts.drones, strict=True))}
    if hosts.world:
        reached[WORLD] = hosts.world
    made = make_peer_certificates(swarm, reached, days, now)
    logins = tuple(fresh.login(agent, made[name]) for agent, name in enumerate(names))
    world = OperatorLogin(swarm, made[WORLD]) if hosts.world else None
    return FleetKeys(OperatorLogin(swarm, made[OPERATOR]), logins, world)
