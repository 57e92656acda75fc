"""A world's link in tests, and those who come to it: the fixtures ``endpoint`` and ``world`` are in conftest.py."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Any

import zenoh

from protocols.wire import keys
from protocols.wire.endpoints import is_secret
from protocols.wire.login import Login
from protocols.wire.transport import secret
from world.server.credentials import make_keys
from world.server.link import WorldLink

SWARM = "wedge"
PATIENCE_S = 20.0  # only what fails takes so long
CREDENTIALS, LOGINS = make_keys(SWARM, 3, ["127.0.0.1"], 1, datetime.now(UTC))


@contextmanager
def intruder(
    endpoint: str,
    login: Login | None,
    mode: str = "client",
    set_up: dict[str, Any] | None = None,
    patience_s: float = PATIENCE_S,
) -> Iterator[zenoh.Session]:
    """Whoever is to be refused needs no long ``patience_s``."""
    settings: dict[str, Any] = {
        **(set_up or {}),
        "mode": mode,
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": round(1000 * patience_s),
        "connect/exit_on_failure": True,
        "listen/endpoints": [],
        "scouting/multicast/enabled": False,
        "scouting/delay": 0,
    }
    if login is not None:
        settings["transport/auth/usrpwd/user"] = keys.user(login.agent)
        settings["transport/auth/usrpwd/password"] = login.password
        if is_secret(endpoint) and login.certificates:
            settings |= secret(login.certificates, "connect")
    config = zenoh.Config()
    for name, value in settings.items():
        config.insert_json5(name, json.dumps(value))
    with zenoh.open(config) as session:
        yield session


def speak(world: WorldLink, session: zenoh.Session, agent: int, words: bytes) -> None:
    """Say ``words`` on the intruder's own key until the world has heard them, and nothing spoofed before."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        session.put(keys.tx(SWARM, agent), words)
        message = world.receive(0.1)
        assert message is None or (message[0] == agent and message[1] != b"spoofed")
        if message == (agent, words):
            break
    else:
        raise AssertionError("the world does not hear even what it may hear")
    session.put(keys.tx(SWARM, agent), b"that is all")
    while (message := world.receive(PATIENCE_S)) != (agent, b"that is all"):
        assert message == (agent, words)


def drain(subscriber: Any, until: bytes | None = None) -> list[tuple[str, bytes]]:
    """What a raw subscriber has heard; with ``until``, wait for that payload to come."""
    heard: list[tuple[str, bytes]] = []
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        sample = subscriber.try_recv()
        if sample is not None:
            heard.append((str(sample.key_expr), sample.payload.to_bytes()))
        if (sample is None and until is None) or (heard and heard[-1][1] == until):
            return heard
        if sample is None:
            time.sleep(0.005)
    raise AssertionError(f"{until!r} never came; heard {heard}")
