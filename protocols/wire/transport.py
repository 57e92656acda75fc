"""How both ends of a link set Zenoh up, and no more than both must agree on. This imports no Zenoh."""

import base64
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, Literal, Protocol, TypeVar

from protocols.wire.keys import MAX_AGENTS
from protocols.wire.login import Certificates

# Zenoh would otherwise take who is stopped for ten seconds for gone, and lose what was under way.
_LEASE_MS = 24 * 3_600_000

# The threads of Zenoh's own. With a pool for each kind of work, cores are busy with switching between a swarm's threads. An agent
# has one thread; the world's reading has one of its own, because it waits while the world has not taken in what was read.
_RUNTIME = "ZENOH_RUNTIME"
_ONE = "(worker_threads:1,max_blocking_threads:2)"
AGENT_RUNTIME = f"(rx:(handover:app),tx:(handover:app),net:(handover:app),acc:(handover:app),app:{_ONE})"
WORLD_RUNTIME = f"(rx:{_ONE},tx:(handover:app),net:(handover:app),acc:(handover:app),app:{_ONE})"

# What a world lets in: so many links at once that have not said yet who they are, and so many that have.
MOST_KNOCKING, MOST_SESSIONS = 2 * MAX_AGENTS, 4 * MAX_AGENTS

COMMON: dict[str, Any] = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "timestamping/enabled": False,
    "transport/unicast/qos/enabled": False,
    "transport/unicast/lowlatency": True,
    "transport/link/tx/lease": _LEASE_MS,
    "transport/shared_memory/enabled": False,  # no gain at these sizes
    # Room for four messages a link. With one, which is not free again when the next is read, Zenoh makes and clears 64 kB for
    # every second message: more than the processor's nearest cache holds.
    "transport/link/rx/buffer_size": 4 * 65_535,
}


class _Config(Protocol):
    def insert_json5(self, key: str, value: str) -> None: ...


C = TypeVar("C", bound=_Config)


def filled(config: C, settings: Mapping[str, Any]) -> C:
    """Zenoh's ``config`` with these settings in it."""
    for name, value in settings.items():
        config.insert_json5(name, json.dumps(value))
    return config


@contextmanager
def few_threads(runtime: str) -> Iterator[None]:
    """Open the first session of a process in here. What this process starts, a world perhaps, does not inherit it; nor counts
    what it has inherited."""
    os.environ[_RUNTIME] = runtime
    try:
        yield
    finally:
        os.environ.pop(_RUNTIME, None)


class _Session(Protocol):
    def close(self) -> object: ...


def leave(session: _Session) -> None:
    """Close it. Over a bad network its farewells may not come through, of which Zenoh makes an error."""
    with suppress(Exception):
        session.close()


def secret(certificates: Certificates, *ends: Literal["connect", "listen"]) -> dict[str, Any]:
    """``tls`` and ``quic`` with certificates on both sides; the keys are handed over in memory. ``ends``: which this one is.

    A link that is open stays open when a certificate expires: nobody is lost in mid-flight for that.
    """
    settings: dict[str, Any] = {
        "transport/link/tls/enable_mtls": True,
        "transport/link/tls/verify_name_on_connect": True,
        "transport/link/tls/root_ca_certificate_base64": _base64(certificates.authority),
    }
    for end in ends:
        settings[f"transport/link/tls/{end}_certificate_base64"] = _base64(certificates.certificate)
        settings[f"transport/link/tls/{end}_private_key_base64"] = _base64(certificates.private_key)
    return settings


def _base64(text: str) -> str:
    return base64.b64encode(text.encode()).decode()
