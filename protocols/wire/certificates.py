"""Certificates of a swarm: making them, and telling whether they are what they should be. Pure: texts in, texts out.

- One authority signs them all and is then thrown away: nobody can add a drone later, not even who steals the makers' files.
- The name in a drone's certificate is the drone, ``agent-3``; it opens links and accepts none. The world's certificate has the
  addresses under which drones find it; it accepts links and opens none. So no drone can pose as the world.
- On the air all are peers: each opens links and accepts them, under the host that its certificate has.
- Keys are ECDSA on P-256. Certificates are valid from a day before they are made, for clocks that are late.
"""

import ipaddress
import re
import secrets
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime, timedelta
from typing import NamedTuple

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from protocols.wire.keys import checked_swarm, user
from protocols.wire.login import Certificates, Login, OperatorLogin

WORLD, OPERATOR = "world", "ground"
_LATE_CLOCKS = timedelta(days=1)
_HOST_NAME = re.compile(r"[A-Za-z0-9-]{1,63}(\.[A-Za-z0-9-]{1,63})*")
_UNREADABLE = (ValueError, TypeError, UnsupportedAlgorithm, x509.InvalidVersion)


class Made(NamedTuple):
    """The certificates of a swarm: the world's, and those of drones 0, 1, 2, ..."""

    world: Certificates
    agents: tuple[Certificates, ...]


def make_certificates(swarm: str, agents: int, world: Sequence[str], days: int, now: datetime) -> Made:
    """New certificates for a world and ``agents`` drones, from the operating system's randomness.

    Args:
        world: under which IP addresses and host names drones find the world.
        now: with a time zone; valid for ``days`` from then on.

    Raises:
        ValueError: no swarm's name, or not an address.
    """
    signed = _authority(swarm, days, now)
    return Made(
        signed(WORLD, world, (ExtendedKeyUsageOID.SERVER_AUTH,)),
        tuple(signed(user(agent), (), (ExtendedKeyUsageOID.CLIENT_AUTH,)) for agent in range(agents)),
    )


def make_peer_certificates(
    swarm: str, hosts: Mapping[str, str], days: int, now: datetime
) -> dict[str, Certificates]:
    """New certificates for peers that open links to each other and accept them: by their names, each with its own host.

    Raises:
        ValueError: no swarm's name, or not an address.
    """
    signed = _authority(swarm, days, now)
    both = (ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH)
    return {name: signed(name, (host,), both) for name, host in hosts.items()}


_Signed = Callable[[str, Sequence[str], Sequence[x509.ObjectIdentifier]], Certificates]


def _authority(swarm: str, days: int, now: datetime) -> _Signed:
    """A new authority, which makes certificates of a name, addresses and usages and is forgotten with what this returns."""
    until = now + timedelta(days=days)
    key = ec.generate_private_key(ec.SECP256R1())
    # A name of its own for every authority: so who was signed by another one is told so, and not of a bad signature.
    name = _name(f"rsc-swarm {checked_swarm(swarm)} {secrets.token_hex(8)}")
    authority = (
        _begun(name, key.public_key(), now, until)
        .issuer_name(name)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .sign(key, hashes.SHA256())
    )

    def signed(who: str, addresses: Sequence[str], usages: Sequence[x509.ObjectIdentifier]) -> Certificates:
        own = ec.generate_private_key(ec.SECP256R1())
        certificate = (
            _begun(_name(who), own.public_key(), now, until)
            .issuer_name(name)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(x509.ExtendedKeyUsage(usages), critical=True)
        )
        if addresses:
            named = x509.SubjectAlternativeName([_address(each) for each in addresses])
            certificate = certificate.add_extension(named, critical=False)
        return Certificates(_pem(authority), _pem(certificate.sign(key, hashes.SHA256())), _key_pem(own))

    return signed


def read_login(text: str) -> Login:
    """Raises ValueError, in one line, if ``text`` is no login, or its certificates are not its agent's."""
    login = Login.from_json(text)
    if login.certificates:
        checked_certificates(login.certificates, user(login.agent))
    return login


def read_operator_login(text: str) -> OperatorLogin:
    """Raises ValueError, in one line, if ``text`` is no operator's login, or its certificates are not an operator's."""
    return _peer_login(text, OPERATOR)


def read_mixed_login(text: str) -> OperatorLogin:
    """Raises ValueError, in one line, if ``text`` is no login of a fleet's world, or its certificates are not a world's."""
    return _peer_login(text, WORLD)


def _peer_login(text: str, name: str) -> OperatorLogin:
    login = OperatorLogin.from_json(text)
    checked_certificates(login.certificates, name)
    return login


def checked_certificates(certificates: Certificates, name: str) -> None:
    """Raises ValueError, in one line, if these are not the certificates of ``name``, at whatever time they are valid."""
    authority, certificate, key = _read(certificates)
    names = [each.value for each in certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)]
    if names != [name]:
        raise ValueError(
            f"its certificate is that of {', '.join(map(repr, names)) or 'nobody'}, not of {name!r}"
        )
    try:
        authority.verify_directly_issued_by(authority)
        certificate.verify_directly_issued_by(authority)
    except (InvalidSignature, *_UNREADABLE):
        raise ValueError("its certificate was not signed by its authority") from None
    if key.public_key() != certificate.public_key():
        raise ValueError("its private key belongs to another certificate")


def refuse_out_of_date(certificates: Certificates, now: datetime) -> None:
    """Raises ValueError, in one line, if one of them is not valid ``now`` (with a time zone)."""
    for certificate in _read(certificates)[:2]:
        first, last = certificate.not_valid_before_utc, certificate.not_valid_after_utc
        if now < first:
            raise ValueError(
                f"its certificate is not valid before {first:%Y-%m-%d %H:%M} UTC, and this machine's clock says "
                f"{now:%Y-%m-%d %H:%M}: set the clock"
            )
        if now > last:
            raise ValueError(
                f"its certificate has expired: it was valid until {last:%Y-%m-%d %H:%M} UTC, and this machine's clock says "
                f"{now:%Y-%m-%d %H:%M}; make new keys with 'rsc-swarm keys', or set the clock"
            )


def refuse_other_address(certificates: Certificates, host: str, again: str | None = None) -> None:
    """Raises ValueError, in one line, if whoever has these certificates is not to be found at ``host``.

    Args:
        again: how new ones are made; without, those of a world.
    """
    try:
        names = _read(certificates)[1].extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        known = [
            *map(str, names.get_values_for_type(x509.IPAddress)),
            *names.get_values_for_type(x509.DNSName),
        ]
    except (x509.ExtensionNotFound, *_UNREADABLE):
        known = []
    if again is None:
        again = f"make new keys with 'rsc-swarm keys --world {host}'"
    if _canonical(host) not in map(_canonical, known):
        raise ValueError(
            f"its certificate is for {', '.join(known) or 'no address'}, not for {host}: no drone would trust it there; "
            f"listen where it is for, or {again}"
        )


def _read(
    certificates: Certificates,
) -> tuple[x509.Certificate, x509.Certificate, ec.EllipticCurvePrivateKey]:
    """Authority, certificate and key. What is read is all that is there, so that nobody else reads something else in it."""
    try:
        authority = x509.load_pem_x509_certificate(certificates.authority.encode())
        certificate = x509.load_pem_x509_certificate(certificates.certificate.encode())
        key = load_pem_private_key(certificates.private_key.encode(), None)
        if isinstance(key, ec.EllipticCurvePrivateKey):
            read = Certificates(_pem(authority), _pem(certificate), _key_pem(key))
            _ = certificate.public_key(), certificate.subject  # read only when asked for
            if read == certificates:
                return authority, certificate, key
    except _UNREADABLE:
        pass
    raise ValueError("its certificates or its private key are damaged")


def _name(common: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common)])


def _begun(
    name: x509.Name, key: ec.EllipticCurvePublicKey, now: datetime, until: datetime
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(name)
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - _LATE_CLOCKS)
        .not_valid_after(until)
    )


def _address(text: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(text))
    except ValueError:
        if not _HOST_NAME.fullmatch(text):
            raise ValueError(
                f"{text!r} is not an address of the world: give an IP address such as 10.0.0.1 or a host name, without a port"
            ) from None
        return x509.DNSName(text)


def _canonical(host: str) -> str:
    try:
        return str(ipaddress.ip_address(host))
    except ValueError:
        return host.lower()


def _pem(certificate: x509.Certificate) -> str:
    return certificate.public_bytes(Encoding.PEM).decode()


def _key_pem(key: ec.EllipticCurvePrivateKey) -> str:
    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()).decode()
