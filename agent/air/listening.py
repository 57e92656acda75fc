"""Whether an address can be listened at, asked before a library is: what that says of it is not for users."""

import errno
import socket

from protocols.fleet.document import places_of
from protocols.wire.keys import LinkError

_DATAGRAMS = ("udp", "quic")


def check_free(address: str) -> None:
    """Raises LinkError if a place of ``address`` (protocol/host:port) is another program's, or none of this machine; one line."""
    for place in places_of(address):
        _check_free(place)


def _check_free(address: str) -> None:
    protocol, _, place = address.partition("/")
    host, _, port = place.rpartition(":")
    kind = socket.SOCK_DGRAM if protocol in _DATAGRAMS else socket.SOCK_STREAM
    try:
        family, _, _, _, where = socket.getaddrinfo(host.strip("[]"), int(port), type=kind)[0]
        with socket.socket(family, kind) as tried:
            if kind is socket.SOCK_STREAM:  # what was closed a moment ago is free
                tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            tried.bind(where)
    except UnicodeError:  # of a name like 10.0.0..1
        raise LinkError(
            f"cannot listen at {address} (no machine can be called so): give an address of this machine"
        ) from None
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise LinkError(
                f"cannot listen at {address}: another program does. Is this fleet in the air already, or has it an operator? End "
                "that one; or, where it is another fleet, give this one other ports: radio: {port: 7550}"
            ) from None
        raise LinkError(
            f"cannot listen at {address} ({error.strerror}): give an address of this machine"
        ) from None
