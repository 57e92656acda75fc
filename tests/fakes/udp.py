"""Fakes on the network: a thread that hands them datagrams, passes their time and sends what they say."""

import itertools
import random
import selectors
import socket
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Protocol

from protocols.closing import Closing
from rsc_swarm.machine.priority import go_first

_STEP_S = 0.005


# Below those that a system gives to whoever asks for any: another program could get one between our asking and our listening.
_candidates = itertools.cycle(random.sample(range(30000, 32700), 2700))


def free_ports(count: int) -> list[int]:
    """Ports of this machine at which nobody listens."""
    return list(itertools.islice(filter(_is_free, _candidates), count))


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as datagrams, socket.socket() as stream:
        try:
            datagrams.bind(("127.0.0.1", port))
            stream.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


class Fake(Protocol):
    """A vehicle at one end of a datagram link."""

    def take(self, datagram: bytes) -> list[bytes]:
        """What it answers at once."""

    def advance(self, dt: float) -> list[bytes]:
        """Time passes; what it says meanwhile."""


class Wires(Closing):
    """Puts each fake behind a UDP port of this machine: it listens there, or speaks to the port that is named.

    Whoever speaks to a fake first is whom it speaks to, until another does.

    Attributes:
        ports: where each listens.
        lock: held while fakes move; take it to look at several numbers of one moment.
    """

    def __init__(self, fakes: Sequence[Fake], towards: Sequence[int] = (), ports: Sequence[int] = ()) -> None:
        """``towards``: where each speaks to first (a vehicle that calls its station), else it waits to be spoken to."""
        self._fakes = list(fakes)
        self._sockets = []
        for index in range(len(self._fakes)):
            one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            one.bind(("127.0.0.1", ports[index] if ports else 0))
            one.setblocking(False)
            self._sockets.append(one)
        self.ports: list[int] = [one.getsockname()[1] for one in self._sockets]
        self._peers: list[tuple[str, int] | None] = [None] * len(self._fakes)
        for index, port in enumerate(towards):
            self._peers[index] = ("127.0.0.1", port)
        self.lock = threading.RLock()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        go_first()  # as drones' processes do: a real vehicle does not wait for them
        selector = selectors.DefaultSelector()
        for index, one in enumerate(self._sockets):
            selector.register(one, selectors.EVENT_READ, index)
        at = time.monotonic()
        while not self._over.is_set():
            for key, _ in selector.select(max(0.0, at + _STEP_S - time.monotonic())):
                self._read(key.data)
            now = time.monotonic()
            # A machine that was busy elsewhere stops all that flies here too: no failsafe acts because a test had to wait.
            dt, at = min(now - at, 0.1), now
            with self.lock:
                for index, fake in enumerate(self._fakes):
                    self._say(index, fake.advance(dt))
        selector.close()

    def _read(self, index: int) -> None:
        for _ in range(100):
            try:
                datagram, self._peers[index] = self._sockets[index].recvfrom(2048)
            except (BlockingIOError, ConnectionError):
                return
            with self.lock:
                self._say(index, self._fakes[index].take(datagram))

    def _say(self, index: int, datagrams: list[bytes]) -> None:
        peer = self._peers[index]
        if peer is None:
            return
        for datagram in datagrams:
            with suppress(BlockingIOError, ConnectionError):
                self._sockets[index].sendto(datagram, peer)

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        for one in self._sockets:
            one.close()
