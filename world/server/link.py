"""The world's end of the wire: the Zenoh router of a run, through which every agent hears and speaks.

- The router knows one login per agent, made fresh for each launch, and denies by default. Agent ``i`` may put
  on ``tx(i)`` and subscribe to ``rx(i)``; it can do nothing else, whatever it declares or asks for.
- Payloads are opaque bytes. What one agent sends arrives in the order in which it was sent.
- ``send`` writes straight into the agent's socket (Zenoh's low-latency transport). It would wait for an agent
  that has stopped reading once its pipe is full, so whoever sends must stop long before that.
- A link must be closed, or the process hangs at exit: use it in a ``with`` statement.
"""

import json
import os
import queue
import re
import secrets
import tempfile
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

import zenoh

from protocols.wire import keys, pieces
from protocols.wire.keys import LinkError, Login


class Credentials(NamedTuple):
    """The logins of one launch: ``passwords[i]`` is agent ``i``'s."""

    swarm: str
    passwords: tuple[str, ...]

    @staticmethod
    def fresh(swarm: str, agents: int) -> "Credentials":
        """New passwords for agents 0 to ``agents - 1``, from the operating system's randomness."""
        if not 1 <= agents <= keys.MAX_AGENTS:
            raise ValueError(f"a swarm has 1 to {keys.MAX_AGENTS} agents, not {agents}")
        return Credentials(keys.checked_swarm(swarm), tuple(secrets.token_urlsafe(24) for _ in range(agents)))

    def login(self, agent: int) -> Login:
        return Login(self.swarm, agent, self.passwords[agent])

    def save_login(self, agent: int, path: Path) -> None:
        """Write the login of one agent as a JSON file only its owner can read, for another machine."""
        _write_private(path, self.login(agent).to_json())

    def dictionary(self) -> str:
        """The router's list of logins, one ``user:password`` per line."""
        return "".join(f"{keys.user(agent)}:{word}\n" for agent, word in enumerate(self.passwords))


def _write_private(path: Path, text: str) -> None:
    path.unlink(missing_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
        file.write(text)


def _access_control(swarm: str, agents: int) -> dict[str, Any]:
    """Default deny; each agent its own two keys."""

    def rule(name: str, message: str, flow: str, key: str) -> dict[str, Any]:
        return {
            "id": name,
            "permission": "allow",
            "messages": [message],
            "flows": [flow],
            "key_exprs": [key],
        }

    # An agent's put leaves its process only while that process knows of a matching subscriber. So the
    # agents must be told of the world's subscription, literally as the world declares it, or all their puts
    # vanish.
    rules = [rule("world-hears", "declare_subscriber", "egress", keys.every_tx(swarm))]
    subjects, policies = [], []
    for agent in range(agents):
        tx, rx = keys.tx(swarm, agent), keys.rx(swarm, agent)
        rules += [
            rule(f"speaks-{agent}", "put", "ingress", tx),
            rule(f"listens-{agent}", "declare_subscriber", "ingress", rx),
            rule(f"hears-{agent}", "put", "egress", rx),
        ]
        subjects.append({"id": keys.user(agent), "usernames": [keys.user(agent)]})
        policies.append(
            {
                "rules": ["world-hears", f"speaks-{agent}", f"listens-{agent}", f"hears-{agent}"],
                "subjects": [keys.user(agent)],
            }
        )
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _open_router(credentials: Credentials, endpoints: Sequence[str]) -> zenoh.Session:
    if not endpoints:
        raise LinkError(
            "the world has no endpoint to listen on: give at least one, for example tcp/0.0.0.0:7447"
        )
    settings: dict[str, Any] = {
        "mode": "router",
        "listen/endpoints": [keys.checked_endpoint(endpoint) for endpoint in endpoints],
        "listen/exit_on_failure": True,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,  # nobody is scouted, so nobody is waited for
        "timestamping/enabled": False,
        "transport/unicast/qos/enabled": False,
        "transport/unicast/lowlatency": True,
        "transport/link/tx/lease": keys.LEASE_MS,
        "transport/shared_memory/enabled": False,  # no gain at these sizes
        "transport/unicast/accept_pending": 2 * keys.MAX_AGENTS,  # a whole swarm may knock at once
        "transport/unicast/max_sessions": 4 * keys.MAX_AGENTS,
        "access_control": _access_control(credentials.swarm, len(credentials.passwords)),
    }
    # The router reads the list of logins while it opens; afterwards no password is left on the disk.
    with tempfile.TemporaryDirectory(prefix="rsc-swarm-logins-") as private:
        dictionary = Path(private) / "logins"
        _write_private(dictionary, credentials.dictionary())
        settings["transport/auth/usrpwd/dictionary_file"] = str(dictionary)
        try:
            config = zenoh.Config()
            for name, value in settings.items():
                config.insert_json5(name, json.dumps(value))
            return zenoh.open(config)
        except zenoh.ZError as error:
            reason = re.sub(r" at /\S*\.rs:\d+\.?", "", str(error))
            raise LinkError(
                f"cannot listen on {', '.join(endpoints)}: {reason}. "
                "Give unixsock-stream//folder/world.sock with an existing folder, "
                "or tcp/ADDRESS:PORT with an address of this machine and a free port"
            ) from error


class WorldLink:
    """The open router. ``endpoints`` say where agents connect, e.g. ``unixsock-stream//run/x/world.sock``.

    Raises LinkError when it cannot listen there.
    """

    def __init__(self, credentials: Credentials, endpoints: Sequence[str]) -> None:
        swarm, agents = credentials.swarm, range(len(credentials.passwords))
        self._agent_of_key = {keys.tx(swarm, agent): agent for agent in agents}
        # The receiving thread of Zenoh puts straight into this queue: no Python thread stands between, and
        # unlike a Zenoh channel it can be waited on for a limited time.
        self._heard: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()
        self._session = _open_router(credentials, endpoints)
        try:
            self._session.declare_subscriber(
                keys.every_tx(swarm), zenoh.handlers.Callback(self._heard.put, indirect=False)
            )
            self._publishers = [
                self._session.declare_publisher(
                    keys.rx(swarm, agent), express=True, congestion_control=zenoh.CongestionControl.DROP
                )
                for agent in agents
            ]
        except BaseException:
            self._session.close()
            raise

    def send(self, agent: int, payload: bytes) -> None:
        """Send to one agent. An agent that is not connected does not get it, now or later."""
        for piece in pieces.cut(payload):
            self._publishers[agent].put(piece)

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        """The next message and the agent that sent it; None if none comes in ``timeout_s`` (0: no wait)."""
        try:
            sample = self._heard.get(timeout=timeout_s) if timeout_s > 0.0 else self._heard.get_nowait()
        except queue.Empty:
            return None
        return self._agent_of_key[str(sample.key_expr)], sample.payload.to_bytes()

    def close(self) -> None:
        if not self._session.is_closed():
            self._session.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
