"""A world's link, over a Unix socket and over TLS; a world that loses its patience soon."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.loopback import fly
from tests.world.links import CREDENTIALS
from tests.world.served import mission
from world import failsafe
from world.server import patience, peer
from world.server.link import WorldLink


@pytest.fixture(params=["unixsock-stream", "tls"])
def endpoint(tmp_path: Path, request: pytest.FixtureRequest) -> str:
    if request.param == "unixsock-stream":
        return f"unixsock-stream/{tmp_path}/world.sock"
    with socket.create_server(("127.0.0.1", 0)) as free:
        return f"{request.param}/127.0.0.1:{free.getsockname()[1]}"


@pytest.fixture
def world(endpoint: str) -> Iterator[WorldLink]:
    with WorldLink(CREDENTIALS, [endpoint]) as link:
        yield link


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """The world waits for a missing answer no longer than it must."""
    fly(mission(fly_s=0.02))  # loads the kernels, which takes longer
    monkeypatch.setattr(patience, "PATIENCE_S", 0.7)
    monkeypatch.setattr(failsafe, "SILENT_S", 0.7)
    monkeypatch.setattr(peer, "TAKEOVER_S", 0.1)
