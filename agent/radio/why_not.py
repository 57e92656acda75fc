"""Why a drone got no link to its world, in one line. Only asked once there is none: it looks for the true reason itself."""

import os
import socket
import ssl
from contextlib import closing, suppress

from protocols.wire.endpoints import SECRET, split
from protocols.wire.keys import user
from protocols.wire.login import Certificates, Login

_PATIENCE_S = 1.0
# What opens a Zenoh session: length (two bytes), InitSyn, version 9, a client, one byte of identity. Zenoh answers with an
# InitAck or, since this names no user, by closing the session.
_OPENING = bytes([4, 0, 1, 9, 2, 7])
_INIT, _CLOSE, _KIND = 0x01, 0x03, 0x1F
_TLS_ALERT = 0x15  # first byte of what a TLS server answers to plain text

# What OpenSSL calls what is wrong with the world's certificate.
_NOT_YET, _EXPIRED, _OTHER_NAME, _OTHER_ADDRESS = 9, 10, 62, 64


def why_not(endpoint: str, login: Login, timeout_s: float) -> str:
    """``login`` got no link at ``endpoint`` within ``timeout_s``: what is wrong, and what would be right."""
    protocol, host, port = split(endpoint)
    absent = (
        f"no world answers at {endpoint} within {timeout_s:g} s: "
        "start the world first, or give the endpoint on which it listens"
    )
    if protocol == "quic":  # over UDP there is nobody to ask
        return f"{absent}; if it is there and its keys were not made with {user(login.agent)}'s, it says so itself"
    try:
        plain = _connected(protocol, host, port)
    except (OSError, ValueError):
        return absent
    with closing(plain):
        if protocol not in SECRET:
            return _why_not_plain(endpoint, login, plain)
        assert login.certificates
        return _why_not_tls(endpoint, login.agent, login.certificates, plain, host)


def _connected(protocol: str, host: str, port: int) -> socket.socket:
    if protocol != "unixsock-stream":
        return socket.create_connection((host, port), timeout=_PATIENCE_S)
    plain = socket.socket(socket.AF_UNIX)
    plain.settimeout(_PATIENCE_S)
    plain.connect(host)
    return plain


def _why_not_plain(endpoint: str, login: Login, plain: socket.socket) -> str:
    answer = _answer(plain)
    if answer[:1] == bytes([_TLS_ALERT]):
        address = endpoint.partition("/")[2]
        return f"the world at {endpoint} speaks TLS: connect to tls/{address}, with this drone's file of 'rsc-swarm keys'"
    return _refused(endpoint, login.agent) if _is_world(answer) else _stranger(endpoint)


def _why_not_tls(
    endpoint: str, agent: int, certificates: Certificates, plain: socket.socket, host: str
) -> str:
    try:
        with _context(certificates).wrap_socket(plain, server_hostname=host) as secret:
            answer = _answer(secret)
    except ssl.SSLCertVerificationError as error:
        return f"{user(agent)} does not trust the world at {endpoint}: {_distrust(error, host)}"
    except ssl.SSLError as error:
        reason = str(error.reason)
        if "EXPIRED" in reason:
            return (
                f"the world at {endpoint} takes {user(agent)}'s certificate for expired or not yet valid: "
                "compare the clocks of both machines"
            )
        if "ALERT" in reason:
            return f"the world at {endpoint} does not trust {user(agent)}: {_OTHER_KEYS}"
        return _speaks_no_tls(endpoint)
    except OSError:
        return _speaks_no_tls(endpoint)
    return _refused(endpoint, agent) if _is_world(answer) else _stranger(endpoint)


def _speaks_no_tls(endpoint: str) -> str:
    _, host, port = split(endpoint)
    with suppress(OSError), closing(_connected("tcp", host, port)) as plain:
        if _is_world(_answer(plain)):
            return (
                f"the world at {endpoint} speaks plain text: let it listen on tls/ with its file of 'rsc-swarm keys', or "
                f"connect to tcp/{endpoint.partition('/')[2]}"
            )
    return _stranger(endpoint)


_OTHER_KEYS = "their keys were not made together; give both what one run of 'rsc-swarm keys' made"


def _distrust(error: ssl.SSLCertVerificationError, host: str) -> str:
    if error.verify_code in (_OTHER_NAME, _OTHER_ADDRESS):
        return (
            f"its certificate is not for {host}; connect to an address that it is for, or make new keys with "
            f"'rsc-swarm keys --world {host}'"
        )
    if error.verify_code == _EXPIRED:
        return "its certificate has expired; make new keys with 'rsc-swarm keys', or set this machine's clock"
    if error.verify_code == _NOT_YET:
        return "its certificate is not valid yet; set this machine's clock"
    return _OTHER_KEYS


def _context(certificates: Certificates) -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.load_verify_locations(cadata=certificates.authority)
    memory = os.memfd_create("certificate")  # Python reads a key from a file only; this one is on no disk
    try:
        os.write(memory, (certificates.certificate + certificates.private_key).encode())
        context.load_cert_chain(f"/proc/self/fd/{memory}")
    finally:
        os.close(memory)
    return context


def _answer(link: socket.socket) -> bytes:
    """What comes back when a Zenoh session is opened; nothing if nothing comes. Raises SSLError when TLS is refused."""
    try:
        link.sendall(_OPENING)
        return link.recv(4096)
    except ssl.SSLError:
        raise
    except OSError:
        return b""


def _is_world(answer: bytes) -> bool:
    return (
        len(answer) > 2
        and int.from_bytes(answer[:2], "little") == len(answer) - 2
        and answer[2] & _KIND in (_INIT, _CLOSE)
    )


def _refused(endpoint: str, agent: int) -> str:
    return (
        f"the world at {endpoint} does not let {user(agent)} in: "
        "use the file that was made for this agent together with the world's"
    )


def _stranger(endpoint: str) -> str:
    return (
        f"something listens at {endpoint} but does not answer as a world does: "
        "another program has that port, the world hangs, or the network loses nearly all"
    )
