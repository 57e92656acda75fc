"""Seals that nobody else can make: Ed25519 signatures."""

from __future__ import annotations

from collections.abc import Sequence

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

KEY_BYTES = 32
_PURPOSE = b"rsc-swarm slots 1 "


class Signatures:
    """The seals (protocols.slots.seals) of one agent of a swarm, good for one flight."""

    def __init__(self, private_key: bytes, public_keys: Sequence[bytes], flight: bytes) -> None:
        """`public_keys[i]` is agent i's; `flight` is told to all at its start and used for no other, so that what was agreed
        to in another flight is worth nothing in this one.

        Raises:
            ValueError: a key is no `KEY_BYTES` long.
        """
        self._private = Ed25519PrivateKey.from_private_bytes(private_key)
        self._public = [Ed25519PublicKey.from_public_bytes(key) for key in public_keys]
        self._head = _PURPOSE + bytes([len(flight)]) + flight

    def seal(self, text: bytes) -> bytes:
        return self._private.sign(self._head + text)

    def holds(self, agent: int, text: bytes, seal: bytes) -> bool:
        try:
            self._public[agent].verify(seal, self._head + text)
        except InvalidSignature:
            return False
        return True


def public_key(private_key: bytes) -> bytes:
    """What goes with a private key, for all others to know."""
    return Ed25519PrivateKey.from_private_bytes(private_key).public_key().public_bytes_raw()
