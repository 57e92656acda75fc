"""An agent's end of the wire: a Zenoh client that speaks to the world on one key and hears it on another.

- Opening waits until the world is there and listens, so that nothing said afterwards is lost.
- What was sent arrives in order. ``send`` waits while the pipe to the world is full: no command may be lost.
- When the world goes away the client keeps trying to reach it again; ``receive`` then simply brings nothing.
- A link must be closed, or the process hangs at exit: use it in a ``with`` statement.
"""

import math
import queue
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from typing import Any

import zenoh

from agent.radio.datagrams import AgentDatagrams
from protocols.beat import Beat
from protocols.closing import Closing
from protocols.wire import keys, pieces
from protocols.wire.endpoints import checked_endpoint, is_secret
from protocols.wire.keys import LinkError
from protocols.wire.login import Login
from protocols.wire.transport import AGENT_RUNTIME, COMMON, few_threads, filled, leave, secret

_LOOK_AGAIN_S = 0.002
_BEAT_S = 0.2  # after so long a wait for a message is looked at again
# More than the world sends to one who does not read: then nothing that Zenoh has read waits for anything.
_MOST_WAITING = 1024
_ASK_AGAIN_S = 0.1  # whether to leave, while waiting for the world


def _check_certificates(endpoint: str, login: Login) -> None:
    """Raises LinkError if ``login`` is no good at ``endpoint``; no world need be asked for that."""
    if not is_secret(endpoint):
        return
    if login.certificates is None:
        raise LinkError(
            f"{keys.user(login.agent)} has no certificate for {endpoint}: use its file of 'rsc-swarm keys', and let the world "
            "use the same keys"
        )
    from protocols.wire.certificates import refuse_out_of_date  # not needed, nor loaded, on one machine

    try:
        refuse_out_of_date(login.certificates, datetime.now(UTC))
    except ValueError as error:
        raise LinkError(f"{keys.user(login.agent)}: {error}") from None


def open_client(
    endpoint: str, login: Login, timeout_s: float, common: Mapping[str, Any] = COMMON
) -> zenoh.Session:
    """A session with the world at ``endpoint``. ``common``: what both ends must agree on.

    Raises:
        LinkError: there is none within ``timeout_s``.
    """
    settings: dict[str, Any] = {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": round(1e3 * timeout_s),
        "connect/exit_on_failure": True,
        "connect/retry": {"period_init_ms": 20, "period_max_ms": 500, "period_increase_factor": 1.5},
        **common,
        "transport/auth/usrpwd/user": keys.user(login.agent),
        "transport/auth/usrpwd/password": login.password,
    }
    if login.certificates and is_secret(endpoint):
        settings |= secret(login.certificates, "connect")
    try:
        with few_threads(AGENT_RUNTIME):
            return zenoh.open(filled(zenoh.Config(), settings))
    except zenoh.ZError as error:
        from agent.radio.why_not import why_not  # loads what only this needs

        raise LinkError(why_not(endpoint, login, timeout_s)) from error


def _asked_to_leave(endpoint: str) -> LinkError:
    return LinkError(f"asked to leave before the world at {endpoint} answered")


def _open_unless(leaving: Callable[[], bool], endpoint: str, login: Login, timeout_s: float) -> zenoh.Session:
    """`open_client` in a thread of its own: while it waits for the world it hears no signal."""
    outcome: queue.SimpleQueue[zenoh.Session | BaseException] = queue.SimpleQueue()

    def wait() -> None:
        try:
            outcome.put(open_client(endpoint, login, timeout_s))
        except BaseException as error:
            outcome.put(error)

    threading.Thread(target=wait, daemon=True).start()
    while not leaving():
        try:
            opened = outcome.get(timeout=_ASK_AGAIN_S)
        except queue.Empty:
            continue
        if isinstance(opened, BaseException):
            raise opened
        return opened
    raise _asked_to_leave(endpoint)


class AgentLink(Closing):
    """The open client of one agent.

    Raises LinkError when the world is not there or refuses the login, or when ``leaving`` says so meanwhile.
    """

    def __init__(
        self,
        endpoint: str,
        login: Login,
        connect_timeout_s: float = 10.0,
        leaving: Callable[[], bool] = lambda: False,
    ) -> None:
        deadline = time.monotonic() + connect_timeout_s
        self._endpoint, self._agent = endpoint, login.agent
        self._datagrams: AgentDatagrams | None = None
        self._joiner = pieces.Joiner()
        _check_certificates(checked_endpoint(endpoint), login)
        self._session = _open_unless(leaving, endpoint, login, connect_timeout_s)
        try:
            # All that comes goes into this one channel without passing through Python: what the world says, datagrams, and a
            # beat, by which a wait ends.
            heard = keys.rx(login.swarm, login.agent)
            self._heard = self._session.declare_subscriber(heard, zenoh.handlers.FifoChannel(_MOST_WAITING))
            self._own = self._session.declare_publisher(
                heard, allowed_destination=zenoh.Locality.SESSION_LOCAL
            )
            self._publisher = self._session.declare_publisher(
                keys.tx(login.swarm, login.agent),
                express=True,
                congestion_control=zenoh.CongestionControl.BLOCK,
            )
            # A publisher drops what it is given before it knows of a subscriber.
            while not self._publisher.matching_status.matching:  # type: ignore[attr-defined]
                if leaving():
                    raise _asked_to_leave(endpoint)
                if time.monotonic() > deadline:
                    raise LinkError(
                        f"the world at {endpoint} does not hear agent {login.agent} of {login.swarm!r}: "
                        "use the file that was made for this agent together with the world's; or, where the network loses much, "
                        "try again"
                    )
                time.sleep(_LOOK_AGAIN_S)
        except BaseException:
            leave(self._session)
            raise
        self._beat = Beat(_BEAT_S, lambda: self._put_in(b""))

    def _put_in(self, message: bytes) -> None:
        with suppress(zenoh.ZError):  # closed meanwhile
            self._own.put(message)

    def send(self, payload: bytes) -> None:
        """Send to the world."""
        self._publisher.put(payload)

    def use_datagrams(self, key: bytes) -> None:
        """The world has offered this process datagrams.

        Raises:
            LinkError: they cannot be had.
        """
        self._datagrams = AgentDatagrams(self._endpoint, self._agent, key, self._put_in)

    def cast(self, payload: bytes) -> bool:
        """Send to the world, in a datagram: it may get lost, but waits for nothing. False where perhaps nobody hears it."""
        return self._datagrams is not None and self._datagrams.send(payload)

    def receive(self, timeout_s: float) -> bytes | None:
        """The next message, oldest first; None when none comes in about ``timeout_s`` (0: do not wait)."""
        until = math.inf
        while True:
            self._beat.waiting = timeout_s > 0.0
            sample = self._heard.recv() if timeout_s > 0.0 else self._heard.try_recv()
            self._beat.waiting = False
            if sample is None:
                return None
            data = sample.payload.to_bytes()
            if pieces.is_whole(data):
                return data
            if data:
                if (message := self._joiner.join(data)) is not None:
                    return message
                continue
            until = min(until, time.monotonic() + timeout_s - _BEAT_S)  # the first beat may come at once
            if time.monotonic() >= until:
                return None

    def close(self) -> None:
        self._beat.close()
        if self._datagrams is not None:
            self._datagrams.close()
        if not self._session.is_closed():
            leave(self._session)
