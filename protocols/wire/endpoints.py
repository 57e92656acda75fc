"""Where a world listens and a drone connects, as Zenoh writes it: ``PROTOCOL/ADDRESS``, for example ``tls/10.0.0.1:7447``.

- ``tls`` and ``quic`` are secret: both ends show a certificate, and nobody on the way reads or changes a byte.
- ``unixsock-stream``, ``tcp`` and ``ws`` are plain text. Off this machine that is done only by an explicit word.
"""

import ipaddress
import re

from protocols.errors import SwarmError
from protocols.wire.keys import LinkError

SECRET = ("tls", "quic")
PLAIN = ("unixsock-stream", "tcp", "ws")
ANYWHERE = ("0.0.0.0", "::")  # every address of a machine

# The protocols that both ends speak; what follows the port is left to Zenoh.
_ENDPOINT = re.compile(
    r"unixsock-stream/(?P<path>.+)|(?P<protocol>tcp|tls|quic|ws)/(?P<host>[^?#\s]+):(?P<port>[0-9]{1,5})([?#].*)?"
)


class PlainTextError(SwarmError, RuntimeError):
    """Plain text would leave this machine, and nobody said that it may."""


def is_port(number: int) -> bool:
    """Whether somebody can be reached at a port of this number."""
    return 0 < number < 65536


def checked_endpoint(endpoint: str) -> str:
    """``endpoint`` itself if it reads like the address of a world, else LinkError."""
    split(endpoint)
    return endpoint


def split(endpoint: str) -> tuple[str, str, int]:
    """Protocol, host (without brackets) and port; of a Unix socket its path, and 0.

    Raises:
        LinkError: it does not read like the address of a world.
    """
    match = _ENDPOINT.fullmatch(endpoint)
    if match and match["path"]:
        return "unixsock-stream", match["path"], 0
    if match and is_port(int(match["port"])):
        return match["protocol"], match["host"].strip("[]"), int(match["port"])
    raise LinkError(
        f"{endpoint!r} is not an endpoint: an endpoint reads tls/ADDRESS:PORT, for example tls/192.168.1.10:7447, "
        "or quic/ADDRESS:PORT, tcp/ADDRESS:PORT or unixsock-stream//folder/world.sock; ports go from 1 to 65535"
    )


def is_secret(endpoint: str) -> bool:
    """Whether what passes there is encrypted, and both ends show who they are."""
    return split(endpoint)[0] in SECRET


def stays_here(endpoint: str) -> bool:
    """Whether what passes there never leaves this machine."""
    protocol, host, _ = split(endpoint)
    return protocol == "unixsock-stream" or is_here(host)


def is_here(host: str) -> bool:
    """Whether what goes there, or comes from there, never leaves this machine."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False  # a name: wherever it leads


def refuse_plain_text(endpoint: str) -> None:
    """Raises PlainTextError if what passes there could be read and changed on its way, LinkError if it is no endpoint."""
    if not is_secret(endpoint) and not stays_here(endpoint):
        address = endpoint.partition("/")[2]
        raise PlainTextError(
            f"{endpoint} is plain text, which everybody on the way can read and change: make keys once with "
            f"'rsc-swarm keys' and use tls/{address}, or say --plain-text (inside a VPN, say)"
        )
