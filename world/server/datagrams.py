"""The world's end of the datagrams (protocols.wire.datagrams): UDP sockets beside the endpoints on which the world listens.

A drone is sent datagrams once one of its own has come, to where the newest came from: so it may sit behind a router that gives
its packets another address, and its address may change in flight.
"""

import socket
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from protocols.wire import datagrams
from protocols.wire.datagrams import Seal
from protocols.wire.keys import LinkError

_LOOK_S = 0.2  # whether it is over


class _Peer:
    """Attributes: process, key: for which process of a drone the key was made. way: where it was last heard, if it was."""

    def __init__(self, agent: int, process: int) -> None:
        self.process, self.key = process, datagrams.fresh_key()
        self.seal = Seal(self.key, agent, at_world=True)
        self.way: tuple[socket.socket, tuple[Any, ...]] | None = None


class WorldDatagrams:
    """Hears on every endpoint that is a network address, and hands on what is of a drone it has given a key.

    Raises LinkError when it cannot listen there.
    """

    def __init__(self, endpoints: Sequence[str], hand_on: Callable[[int, bytes], None]) -> None:
        """``hand_on`` is called with each drone and message, in threads of this object."""
        self._hand_on, self._closed, self._unwrapping = hand_on, threading.Event(), threading.Lock()
        self._peers: dict[int, _Peer] = {}
        self._sockets: list[socket.socket] = []
        try:
            for endpoint in endpoints:
                self._listen(endpoint)
        except OSError as error:
            self.close()
            raise LinkError(
                f"cannot listen for datagrams of {endpoint}: {error.strerror or error}. In real time the world listens on the "
                "UDP port of the same number (quic: one beside it): free it, or choose another port"
            ) from error
        if self._sockets:
            datagrams.share_time()
        for one in self._sockets:
            threading.Thread(target=self._hear, args=(one,), daemon=True).start()

    def _listen(self, endpoint: str) -> None:
        place = datagrams.place_of(endpoint)
        if place is None:
            return
        family, kind, protocol, _, address = socket.getaddrinfo(*place, type=socket.SOCK_DGRAM)[0]
        one = socket.socket(family, kind, protocol)
        self._sockets.append(one)
        one.settimeout(_LOOK_S)
        one.bind(address)

    def offer(self, agent: int, process: int) -> bytes | None:
        """The key for this process of a drone, which supersedes that of its last one; None if nobody listens for datagrams."""
        if not self._sockets:
            return None
        peer = self._peers.get(agent)
        if peer is None or peer.process != process:
            peer = self._peers[agent] = _Peer(agent, process)
        return peer.key

    def send(self, agent: int, message: bytes) -> bool:
        """Send it; False if it is not known where the drone is."""
        peer = self._peers.get(agent)
        if peer is None or peer.way is None:
            return False
        way, address = peer.way
        with suppress(OSError):  # no way there now, or no room: it is as lost as others
            for datagram in peer.seal.wrap(message):
                way.sendto(datagram, address)
        return True

    def _hear(self, one: socket.socket) -> None:
        while not self._closed.is_set():
            try:
                data, address = one.recvfrom(datagrams.SIZE + 1)
            except OSError:  # nothing came, or an earlier datagram was turned back
                continue
            agent = datagrams.sender_of(data)
            peer = self._peers.get(agent)
            if peer is None:
                continue
            with self._unwrapping:  # two endpoints may hear a copy each of one datagram at once
                genuine, message = peer.seal.unwrap(data)
            if genuine:
                peer.way = one, address
            if message is not None:
                self._hand_on(agent, message)

    def close(self) -> None:
        self._closed.set()
        for one in self._sockets:
            one.close()
