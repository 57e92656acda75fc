"""Somebody who looks on and lays hands on a flight at given ticks, through the window that a page has."""

import json
import socket
from collections.abc import Mapping
from typing import Any

from rsc_swarm.watch.window import WORD, Window
from world.director import Director


class Handed:
    """An onlooker. ``hands``: fields of faults, by the tick before which they are wanted. ``words``: what was told."""

    def __init__(self, hands: Mapping[int, dict[str, Any]]) -> None:
        self._hands = hands
        ours, self._theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._theirs.setblocking(False)
        self._window = Window(ours)
        self._ours = ours
        self.words: list[dict[str, Any]] = []

    def attend(self, director: Director) -> float:
        if director.clock in self._hands and director.core.active[0]:
            self._theirs.send(json.dumps({"fault": self._hands[director.clock]}).encode())
        wait = self._window.attend(director)
        try:
            while True:
                message = self._theirs.recv(1 << 20)
                if message[:1] == WORD:
                    self.words.append(json.loads(message[1:]))
        except BlockingIOError:
            return wait
