"""The world's end of the wire: the Zenoh router of a run, through which every agent hears and speaks.

- The router knows one login per agent and denies by default. On ``tls`` and ``quic`` an agent must also show the certificate
  that has its name. Agent ``i`` may put on ``tx(i)`` and subscribe to ``rx(i)``; it can do nothing else, whatever it declares
  or asks for.
- Payloads are opaque bytes. What one agent sends arrives in the order in which it was sent. What is too long is turned away at
  the door; while too much waits there, Zenoh reads no further.
- ``send`` writes straight into the agent's socket (Zenoh's low-latency transport). It waits for an agent that has stopped
  reading once its pipe is full, so whoever sends must stop long before that; if not, the pipe is cut (world.server.pipes).
- A link must be closed, or the process hangs at exit: use it in a ``with`` statement.
"""

import math
import os
import re
import time
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime
from typing import Any

import zenoh

from protocols.beat import Beat
from protocols.closing import Closing
from protocols.wire import keys, messages, pieces
from protocols.wire.endpoints import ANYWHERE, PLAIN, SECRET, is_secret, split
from protocols.wire.keys import LinkError
from protocols.wire.transport import (
    COMMON,
    MOST_KNOCKING,
    MOST_SESSIONS,
    WORLD_RUNTIME,
    few_threads,
    filled,
    leave,
    secret,
)
from world.server.credentials import Credentials
from world.server.datagrams import WorldDatagrams
from world.server.pipes import Lookout


def _check_endpoints(credentials: Credentials, endpoints: Sequence[str]) -> None:
    """Raises LinkError if a world with these credentials should not listen there."""
    if not endpoints:
        raise LinkError(
            "the world has no endpoint to listen on: give at least one, for example tls/10.0.0.1:7447 or tcp/127.0.0.1:7447"
        )
    for endpoint in filter(is_secret, endpoints):
        if credentials.certificates is None:
            raise LinkError(
                f"the world has no certificate for {endpoint}: make keys once with 'rsc-swarm keys', and give them with --keys"
            )
        from protocols.wire.certificates import refuse_other_address, refuse_out_of_date  # loaded only here

        try:
            refuse_out_of_date(credentials.certificates, datetime.now(UTC))
            if (host := split(endpoint)[1]) not in ANYWHERE:
                refuse_other_address(credentials.certificates, host)
        except ValueError as error:
            raise LinkError(f"the world: {error}") from None


def _access_control(swarm: str, agents: int, certified: bool = False) -> dict[str, Any]:
    """Default deny; each agent its own two keys.

    certified: there are ``tls`` or ``quic`` endpoints. There an agent is who both its password and its certificate name.
    """

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
        known = _known(keys.user(agent), certified)
        subjects += known
        policies.append(
            {
                "rules": ["world-hears", f"speaks-{agent}", f"listens-{agent}", f"hears-{agent}"],
                "subjects": [subject["id"] for subject in known],
            }
        )
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _known(user: str, certified: bool) -> list[dict[str, Any]]:
    """By what an agent is known, on each kind of link."""
    plain = {"id": user, "usernames": [user]}
    if not certified:
        return [plain]
    return [
        plain | {"link_protocols": PLAIN},
        plain | {"id": f"{user}-certified", "cert_common_names": [user], "link_protocols": SECRET},
    ]


def _open_router(credentials: Credentials, endpoints: Sequence[str]) -> zenoh.Session:
    certified = any(map(is_secret, endpoints))
    settings: dict[str, Any] = {
        "mode": "router",
        "listen/endpoints": list(endpoints),
        "listen/exit_on_failure": True,
        "scouting/delay": 0,  # nobody is scouted, so nobody is waited for
        **COMMON,
        "transport/unicast/accept_pending": MOST_KNOCKING,
        "transport/unicast/max_sessions": MOST_SESSIONS,
        # With whoever does not want this transport of ours Zenoh speaks its usual one. There it would join fragments up to a
        # gigabyte, and, with the one thread that reads from all, wait 5 s for one that declares much and reads nothing.
        "transport/link/rx/max_message_size": messages.MAX_FROM_DRONE,
        "transport/link/tx/queue/congestion_control/block/wait_before_close": 1000,  # microseconds
        "access_control": _access_control(credentials.swarm, len(credentials.passwords), certified),
    }
    if credentials.certificates and certified:
        settings |= secret(credentials.certificates, "listen")
    # The router reads the list of logins, from a file only, while it opens; this file is in memory, on no disk.
    dictionary = os.memfd_create("logins")
    try:
        os.write(dictionary, credentials.dictionary().encode())
        settings["transport/auth/usrpwd/dictionary_file"] = f"/proc/self/fd/{dictionary}"
        with few_threads(WORLD_RUNTIME):
            return zenoh.open(filled(zenoh.Config(), settings))
    except zenoh.ZError as error:
        reason = re.sub(r" at /\S*\.rs:\d+\.?", "", str(error))
        raise LinkError(
            f"cannot listen on {', '.join(endpoints)}: {reason}. "
            "Give unixsock-stream//folder/world.sock with an existing folder, "
            "or tls/ADDRESS:PORT or tcp/ADDRESS:PORT with an address of this machine and a free port"
        ) from error
    finally:
        os.close(dictionary)


_BEAT_S = 0.1
# Messages of all agents that wait to be read. Zenoh's receiving thread waits while there are so many.
_MOST_WAITING = 1024


class WorldLink(Closing):
    """The open router. ``endpoints`` say where agents connect, e.g. ``unixsock-stream//run/x/world.sock``.

    Raises LinkError when it cannot listen there.
    """

    def __init__(self, credentials: Credentials, endpoints: Sequence[str], realtime: bool = False) -> None:
        """``realtime``: hear and send datagrams besides."""
        _check_endpoints(credentials, endpoints)
        swarm, agents = credentials.swarm, range(len(credentials.passwords))
        self._keys, self._pulse = [keys.tx(swarm, agent) for agent in agents], keys.pulse(swarm)
        self._agent_of_key = {key: agent for agent, key in enumerate(self._keys)}
        self._turned_away = [0 for _ in agents]
        self._barred: set[int] = set()
        self._sends = 0
        self._session = _open_router(credentials, endpoints)
        try:
            # All that comes goes into this one channel without passing through Python: what agents say, datagrams, and a beat
            # that nobody else can put there, by which a wait ends.
            self._heard = self._session.declare_subscriber(
                keys.every_tx(swarm), zenoh.handlers.FifoChannel(_MOST_WAITING)
            )
            self._publishers = [
                self._session.declare_publisher(
                    keys.rx(swarm, agent), express=True, congestion_control=zenoh.CongestionControl.DROP
                )
                for agent in agents
            ]
            self._datagrams = WorldDatagrams(endpoints if realtime else (), self._hear_datagram)
        except BaseException:
            leave(self._session)
            raise
        self._lookout, self._beat = Lookout(), Beat(_BEAT_S, self._wake)

    def send(self, agent: int, payload: bytes) -> None:
        """Send to one agent. An agent that is not connected does not get it, now or later."""
        self._sends += 1
        self._lookout.sending, put = self._sends, self._publishers[agent].put
        if len(payload) <= pieces.LONGEST and pieces.is_whole(payload):
            put(payload)
        else:
            for piece in pieces.cut(payload, self._sends):
                put(piece)
        self._lookout.sending = None

    def offer(self, agent: int, process: int) -> bytes | None:
        """The key with which this process of a drone may speak in datagrams; None where there are none."""
        return self._datagrams.offer(agent, process)

    def cast(self, agent: int, payload: bytes) -> bool:
        """Send to one agent, in datagrams: it may get lost, but waits for nothing. False where that cannot be, or not yet."""
        return self._datagrams.send(agent, payload)

    def _hear_datagram(self, agent: int, message: bytes) -> None:
        self._put_in(self._keys[agent], message)

    def _wake(self) -> None:
        self._put_in(self._pulse, b"")

    def _put_in(self, key: str, message: bytes) -> None:
        with suppress(zenoh.ZError):  # closed meanwhile
            self._session.put(key, message, allowed_destination=zenoh.Locality.SESSION_LOCAL)

    def turned_away(self, agent: int) -> int:
        """Messages of this agent so far that were too long."""
        return self._turned_away[agent]

    def bar(self, agent: int) -> None:
        """From now on take in nothing from this agent."""
        self._barred.add(agent)

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        """The next message and the agent that sent it; None if none comes in about ``timeout_s`` (0: no wait). What comes in a
        wait that is shorter than a beat is read at its end.
        """
        if 0.0 < timeout_s < _BEAT_S:
            if (received := self.receive(0.0)) is not None:
                return received
            time.sleep(timeout_s)
            timeout_s = 0.0
        until = math.inf
        while True:
            self._beat.waiting = timeout_s > 0.0
            sample = self._heard.recv() if timeout_s > 0.0 else self._heard.try_recv()
            self._beat.waiting = False
            if sample is None:
                return None
            agent, data = self._agent_of_key.get(str(sample.key_expr)), sample.payload.to_bytes()
            if agent is not None and agent not in self._barred:
                if len(data) <= messages.MAX_FROM_DRONE:
                    return agent, data
                self._turned_away[agent] += 1
            until = min(until, time.monotonic() + timeout_s - _BEAT_S)  # the first beat may come at once
            if time.monotonic() >= until:
                return None

    def close(self) -> None:
        self._lookout.close()
        self._beat.close()
        self._datagrams.close()
        if not self._session.is_closed():
            leave(self._session)
