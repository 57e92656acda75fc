"""A world's link, over a Unix socket and over TLS."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.world.links import CREDENTIALS
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
