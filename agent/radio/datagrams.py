"""A drone's end of the datagrams (protocols.wire.datagrams): a UDP socket to the world."""

import socket
import threading
from collections.abc import Callable
from contextlib import suppress

from protocols.wire import datagrams
from protocols.wire.datagrams import Seal
from protocols.wire.keys import LinkError

_LOOK_S = 0.2  # whether it is over


class AgentDatagrams:
    """Datagrams of one process of drone ``agent`` to and from the world at ``endpoint``.

    Attributes:
        heard: whether one has come, so that the way is open.

    Raises LinkError when the world has no address, or this machine no way to it.
    """

    def __init__(self, endpoint: str, agent: int, key: bytes, hand_on: Callable[[bytes], None]) -> None:
        """``hand_on`` is called with each message, in a thread of this object."""
        self.heard = False
        self._hand_on, self._closed = hand_on, threading.Event()
        self._seal = Seal(key, agent, at_world=False)
        place = datagrams.place_of(endpoint)
        if place is None:
            raise LinkError(f"the world offers datagrams at {endpoint}, which has no port for them")
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(*place, type=socket.SOCK_DGRAM)[0]
            self._socket, self._address = socket.socket(family, kind, protocol), address
            self._socket.bind(("", 0))
        except OSError as error:
            raise LinkError(f"no datagrams can go to {endpoint}: {error.strerror or error}") from error
        self._socket.settimeout(_LOOK_S)
        datagrams.share_time()
        threading.Thread(target=self._hear, daemon=True).start()

    def send(self, message: bytes) -> bool:
        """Send it; False while it is not known whether the way is open."""
        with suppress(OSError):  # no way there now, or no room: it is as lost as others
            for datagram in self._seal.wrap(message):
                self._socket.sendto(datagram, self._address)
        return self.heard

    def _hear(self) -> None:
        while not self._closed.is_set():
            try:
                data = self._socket.recv(datagrams.SIZE + 1)
            except OSError:  # nothing came, or an earlier datagram was turned back
                continue
            genuine, message = self._seal.unwrap(data)
            self.heard = self.heard or genuine
            if message is not None:
                self._hand_on(message)

    def close(self) -> None:
        self._closed.set()
        self._socket.close()
