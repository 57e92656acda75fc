"""The world's voice to single drones: never more than a pipe has room for. Who is welcomed, and who is refused."""

import secrets
import sys
from collections.abc import Sequence
from typing import Any

from protocols.wire import messages
from world.server.peer import Peer
from world.server.ports import Link

_UNKNOWN = "the world does not know this process: it has been started anew"


class Reception:
    """For the drones behind ``peers``, in one flight; ``briefing``, ``initial_slots`` and ``watched`` as in Welcome."""

    def __init__(
        self,
        link: Link,
        peers: Sequence[Peer],
        briefing: dict[str, Any],
        initial_slots: bytes,
        watched: bool = False,
    ) -> None:
        self._link, self._peers, self._briefing, self._initial_slots = link, peers, briefing, initial_slots
        self._watched = watched
        self._flight = secrets.token_bytes(messages.FLIGHT_BYTES)
        self._refused: set[int] = set()

    def send(self, agent: int, message: messages.FromWorld) -> None:
        """Say this, if there is room."""
        packed, peer = messages.pack(message), self._peers[agent]
        if peer.room(len(packed)):
            peer.tell(len(packed))
            self._link.send(agent, packed)

    def say_bye(self) -> None:
        """To all."""
        for agent in range(len(self._peers)):
            self._link.cast(agent, messages.pack(messages.Bye()))
            self.send(agent, messages.Bye())

    def greet(self, agent: int, hello: messages.Hello, now_s: float, paused: bool) -> bool:
        """A process says Hello for a drone that flies; whether it is, or has just become, the drone and is to begin."""
        peer = self._peers[agent]
        if not peer.knock(hello.process, now_s, paused) or peer.ready:
            return False
        key = self._link.offer(agent, hello.process) or b""
        told = self._briefing, self._initial_slots, peer.boot, self._flight, key, self._watched
        self.send(agent, messages.Welcome(hello.process, *told))
        return True

    def refuse_version(self, agent: int, hello: messages.Hello) -> str | None:
        """Refuse a process that speaks another version than the world: how it is told so; None if it speaks the same."""
        if hello.version == messages.VERSION:
            return None
        wrong = f"agent {agent} speaks version {hello.version} of the messages, the world {messages.VERSION}"
        self.send(agent, messages.Refused(hello.process, wrong))
        return wrong

    def heard(self, agent: int) -> None:
        """This drone was heard, so whoever knocked meanwhile is not the drone."""
        if (rival := self._peers[agent].heard()) is not None:
            self.refuse(agent, rival)

    def refuse(self, agent: int, process: int) -> None:
        """This process is not the drone."""
        if self._peers[agent].process is None:
            self.send(agent, messages.Refused(process, _UNKNOWN))
            return
        why = (
            f"another process flies as agent {agent} already: end it first, or use the login of another agent"
        )
        self.send(agent, messages.Refused(process, why))
        if process not in self._refused and len(self._refused) < len(self._peers):
            self._refused.add(process)
            print(f"world: a second process with the login of agent {agent} was refused", file=sys.stderr)
