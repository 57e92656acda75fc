"""What a drone must have to join a swarm as itself: one small JSON file, made by ``rsc-swarm keys`` or by a world."""

from dataclasses import dataclass, field
from functools import cache
from typing import Annotated, Any, TypeVar, cast

from pydantic import StringConstraints, TypeAdapter, ValidationError

from protocols.wire.keys import checked_agent, checked_swarm

# What a line of the router's list of passwords can hold.
Password = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{1,256}$")]


@dataclass(frozen=True)
class Certificates:
    """How one end of a ``tls`` or ``quic`` link shows who it is, and knows the other: three PEM texts.

    authority: of whoever made the keys; it signed the certificate of everybody in the swarm. certificate: one's own; the name in
    it is the drone (``agent-3``), or ``world``. private_key: of that certificate, PKCS 8.
    """

    authority: str
    certificate: str
    private_key: str = field(repr=False)


SealKey = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]


@dataclass(frozen=True)
class SealKeys:
    """With what a drone seals the swaps it agrees to, and knows the seals of others (protocols.slots.signatures): Ed25519 keys.

    public_keys: agent i's is number i.
    """

    private_key: SealKey = field(repr=False)
    public_keys: tuple[SealKey, ...]


@dataclass(frozen=True)
class Login:
    """All an agent must have, besides an endpoint. Its secrets do not show when it is printed."""

    swarm: str
    agent: int
    password: Password = field(repr=False)
    certificates: Certificates | None = None
    seals: SealKeys | None = None

    def to_json(self) -> str:
        return to_json(self)

    @staticmethod
    def from_json(text: str) -> "Login":
        """Raises ValueError when ``text`` is not what ``to_json`` wrote. Whose certificates are in it is not looked at here."""
        login = from_json(Login, text, "an agent's login")
        checked_swarm(login.swarm)
        checked_agent(login.agent)
        return login


@dataclass(frozen=True)
class OperatorLogin:
    """All an operator of a fleet must have. Its secrets do not show when it is printed."""

    swarm: str
    certificates: Certificates

    def to_json(self) -> str:
        return to_json(self)

    @staticmethod
    def from_json(text: str) -> "OperatorLogin":
        """Raises ValueError when ``text`` is not what ``to_json`` wrote. Whose certificates are in it is not looked at here."""
        login = from_json(OperatorLogin, text, "an operator's login")
        checked_swarm(login.swarm)
        return login


_Kind = TypeVar("_Kind")


@cache  # made for the first file, and not when this is imported: a launch reads none
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def to_json(what: object) -> str:
    """What `from_json` reads."""
    return _adapter(cast(Any, type(what))).dump_json(what, indent=2, exclude_none=True).decode() + "\n"


def from_json(kind: type[_Kind], text: str, name: str) -> _Kind:
    """Raises ValueError, in one line, when ``text`` is not ``name``, a ``kind``."""
    try:
        found: _Kind = _adapter(cast(Any, kind)).validate_json(text, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        field_name = ".".join(map(str, first["loc"])) or "the whole"
        raise ValueError(
            f"is not {name} ({field_name}: {first['msg'][0].lower()}{first['msg'][1:]}); "
            "use a file as 'rsc-swarm keys' or the world writes it, unchanged"
        ) from None
    return found
